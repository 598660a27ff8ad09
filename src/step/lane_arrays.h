// Arrays of lanes and masks, as the step uses them.
#pragma once
#include "lane/lane.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template <class S>
STICKSLIP_INLINE void copy(const S* from, int n, S* to) {
  for (int k = 0; k < n; ++k) to[k] = from[k];
}
/// to <- from in the lanes of the mask.
template <class S>
STICKSLIP_INLINE void copy_where(Mask<S> m, const S* from, int n, S* to) {
  for (int k = 0; k < n; ++k) to[k] = select(m, from[k], to[k]);
}
template <class S>
STICKSLIP_INLINE Mask<S> none() {
  const S o = constant<S>(0);
  return o < o;
}
/// Lanes whose sum of sizes is neither NaN nor infinite.
template <class S>
STICKSLIP_INLINE Mask<S> is_finite(S sum_of_sizes) {
  return sum_of_sizes <= constant<S>(sizeof(Value<S>) == 4 ? 3.4028234e38 : 1.7976931348623157e308);
}
template <class S>
STICKSLIP_INLINE S sum_of_sizes(const S* values, int n, S sum) {
  for (int k = 0; k < n; ++k) sum = sum + abs(values[k]);
  return sum;
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
