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
  if (all(m))  // as most often: nothing of `to` has to be read
    copy(from, n, to);
  else
    for (int k = 0; k < n; ++k) to[k] = select(m, from[k], to[k]);
}
template <class S>
STICKSLIP_INLINE void swap(S*& a, S*& b) {
  S* c = a;
  a = b;
  b = c;
}
/// a <-> b in the lanes of the mask.
template <class S>
STICKSLIP_INLINE void swap_where(Mask<S> m, int n, S* a, S* b) {
  for (int k = 0; k < n; ++k) {
    const S x = a[k];
    a[k] = select(m, b[k], x);
    b[k] = select(m, x, b[k]);
  }
}
/// to <- 0 in the lanes of the mask.
template <class S>
STICKSLIP_INLINE void clear_where(Mask<S> m, int n, S* to) {
  const S zero = constant<S>(0);
  if (all(m))
    for (int k = 0; k < n; ++k) to[k] = zero;
  else
    for (int k = 0; k < n; ++k) to[k] = select(m, zero, to[k]);
}
/// Lanes whose number is neither NaN nor infinite.
template <class S>
STICKSLIP_INLINE Mask<S> is_finite(S x) {
  return abs(x) <= constant<S>(sizeof(Value<S>) == 4 ? 3.4028234e38 : 1.7976931348623157e308);
}
/// Lanes whose n numbers all are: zero times any other is NaN. In four chains.
template <class S>
STICKSLIP_INLINE Mask<S> are_finite(const S* values, int n) {
  const S zero = constant<S>(0);
  S part[4] = {zero, zero, zero, zero};
  int k = 0;
  for (; k + 4 <= n; k += 4)
    for (int j = 0; j < 4; ++j) part[j] = madd(values[k + j], zero, part[j]);
  for (; k < n; ++k) part[0] = madd(values[k], zero, part[0]);
  return (part[0] + part[1]) + (part[2] + part[3]) <= zero;
}
/// A residual as it is reported: infinite where the problem was refused, so that the largest of
/// several says so.
template <class S>
STICKSLIP_INLINE S reported_residual(S residual) {
  return select(is_finite(residual), residual, constant<S>(__builtin_inf()));
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
