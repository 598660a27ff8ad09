// The base's six rows of the factor: L_b^T L_b is the articulated inertia of the base
// (docs/theory/dynamics.md, section 4).
#pragma once
#include "dynamics/tree.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

template <class S>
STICKSLIP_INLINE void to_rows(const Spatial<S>& f, S row[6]) {  // linear, angular: the order of u
  row[0] = f.lin.x, row[1] = f.lin.y, row[2] = f.lin.z;
  row[3] = f.ang.x, row[4] = f.ang.y, row[5] = f.ang.z;
}
template <class S>
STICKSLIP_INLINE Spatial<S> from_rows(const S row[6]) {
  return {{row[3], row[4], row[5]}, {row[0], row[1], row[2]}};
}

/// Factors the 6x6 of a floating base, rows linear then angular, last row first.
template <class S>
void factor_base(BaseState<S>& base) {
  S(&m)[6][6] = base.factor;
  const auto& i = base.articulated;
  const Sym3<S>&l = i.ll, &a = i.aa;
  m[0][0] = l.xx, m[1][0] = l.xy, m[1][1] = l.yy, m[2][0] = l.xz, m[2][1] = l.yz, m[2][2] = l.zz;
  m[3][3] = a.xx, m[4][3] = a.xy, m[4][4] = a.yy, m[5][3] = a.xz, m[5][4] = a.yz, m[5][5] = a.zz;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m[3 + r][c] = i.al.m[3 * r + c];
  // The square root stays off the chain from one row to the next: only the division is on it.
#pragma GCC unroll 6
  for (int j = 5; j >= 0; --j) {
    const S inverse = constant<S>(1) / m[j][j];
    base.diagonal[j] = sqrt(m[j][j]);
    base.inv_diagonal[j] = base.diagonal[j] * inverse;
#pragma GCC unroll 6
    for (int k = 0; k < j; ++k) {
      const S scaled = m[j][k] * inverse;
#pragma GCC unroll 6
      for (int n = 0; n <= k; ++n) m[k][n] = nmadd(scaled, m[j][n], m[k][n]);
    }
#pragma GCC unroll 6
    for (int k = 0; k < j; ++k) m[j][k] = m[j][k] * base.inv_diagonal[j];
  }
}

/// x <- L_b^-T x
template <class X, class S>
STICKSLIP_INLINE void solve_base_transposed(const BaseState<S>& base, X x[6]) {
#pragma GCC unroll 6
  for (int j = 5; j >= 0; --j) {
    x[j] = x[j] * base.inv_diagonal[j];
#pragma GCC unroll 6
    for (int k = 0; k < j; ++k) x[k] = nmadd(x[j], base.factor[j][k], x[k]);
  }
}

/// x <- L_b^-1 x
template <class S>
STICKSLIP_INLINE void solve_base(const BaseState<S>& base, S x[6]) {
#pragma GCC unroll 6
  for (int j = 0; j < 6; ++j) {
#pragma GCC unroll 6
    for (int k = 0; k < j; ++k) x[j] = nmadd(x[k], base.factor[j][k], x[j]);
    x[j] = x[j] * base.inv_diagonal[j];
  }
}

/// base.x = L_b (translation, base.velocity)
template <class S>
STICKSLIP_INLINE void multiply_base(BaseState<S>& base, const Vec3<S>& translation) {
  S u[6];
  to_rows(Spatial<S>{base.velocity.ang, translation}, u);
  for (int j = 0; j < 6; ++j) {
    base.x[j] = base.diagonal[j] * u[j];
    for (int k = 0; k < j; ++k) base.x[j] = madd(base.factor[j][k], u[k], base.x[j]);
  }
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
