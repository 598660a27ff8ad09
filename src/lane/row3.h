// Three rows (x, y, z of a contact) handled together: for a plain scalar one SIMD register, for a
// pack three packs. Either way each row is the same sequence of operations, so the bits are equal.
#pragma once
#include "lane/pack.h"

namespace stickslip::inline STICKSLIP_KERNELS {

template <class S>
struct Row3 {
  S x, y, z;
};
template <>
struct Row3<double> {
  Pack<double, 4> v;  // lane 3 is unused
};
template <>
struct Row3<float> {
  Pack<float, 4> v;
};

template <class S>
STICKSLIP_INLINE Row3<S> make_row3(S x, S y, S z) {
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return {Pack<S, 4>(typename Pack<S, 4>::Vector{x, y, z, S(0)})};
  else
    return {x, y, z};
}
template <class S>
STICKSLIP_INLINE void store(const Row3<S>& a, S out[3]) {
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    for (int r = 0; r < 3; ++r) out[r] = a.v.v[r];
  } else {
    out[0] = a.x, out[1] = a.y, out[2] = a.z;
  }
}
/// to = a, number by number, as spatial/numbers.h does it and for its reason.
template <class S>
STICKSLIP_INLINE void store(const Row3<S>& a, Row3<S>& to) {
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    to.v = a.v;
  } else {
    to.x = a.x, to.y = a.y, to.z = a.z;
  }
}
template <class S>
STICKSLIP_INLINE Row3<S> operator*(const Row3<S>& a, S b) {
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return {a.v * Pack<S, 4>(b)};
  else
    return {a.x * b, a.y * b, a.z * b};
}
template <class S>
STICKSLIP_INLINE Row3<S> operator+(const Row3<S>& a, const Row3<S>& b) {
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return {a.v + b.v};
  else
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class S>
STICKSLIP_INLINE Row3<S> madd(const Row3<S>& a, S b, const Row3<S>& c) {  // a * b + c
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return {madd(a.v, Pack<S, 4>(b), c.v)};
  else
    return {madd(a.x, b, c.x), madd(a.y, b, c.y), madd(a.z, b, c.z)};
}
template <class S>
STICKSLIP_INLINE Row3<S> nmadd(const Row3<S>& a, S b, const Row3<S>& c) {  // c - a * b
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return {nmadd(a.v, Pack<S, 4>(b), c.v)};
  else
    return {nmadd(a.x, b, c.x), nmadd(a.y, b, c.y), nmadd(a.z, b, c.z)};
}

/// a in the lanes of the mask, b elsewhere.
template <class S>
STICKSLIP_INLINE Row3<S> select(Mask<S> m, const Row3<S>& a, const Row3<S>& b) {
  S x[3], y[3];
  store(a, x);
  store(b, y);
  return make_row3(select(m, x[0], y[0]), select(m, x[1], y[1]), select(m, x[2], y[2]));
}
/// a in the lanes of the mask; zero elsewhere.
template <class S>
STICKSLIP_INLINE Row3<S> row_where(Mask<S> m, const Row3<S>& a) {
  const S zero = constant<S>(0);
  return select(m, a, make_row3(zero, zero, zero));
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
