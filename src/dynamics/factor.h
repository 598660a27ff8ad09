// M = L^T L from the tips to the base. L is never written out: its row of joint i is
//   L_ij = U_i . s_j (ancestors j),  L_ii = sqrt(D_i),  U_i = I_A s_i / sqrt(D_i),  D_i = s_i . I_A
//   s_i,
// with I_A the articulated-body inertia [Featherstone 2008, sec. 6.5, 7.2]. All U_i are forces at
// the base origin, so a row costs six numbers however deep the tree is. Why not the parent array:
// docs/design/003-articulated-factor.md. Proof: docs/theory/dynamics.md (D7)-(D10).
#pragma once
#include "dynamics/kinematics.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

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

/// Factors M + diag(extra). `extra` (num_joints): joint-space diagonal terms, such as implicit
/// damping; may be null.
template <class S>
void factor_mass_matrix(Tree<S>& t, const S* extra) {
  using W = Wide<S>;
  for (int slot = 0; slot < t.num_slots; ++slot)
    if (t.slots[slot].has_children) t.links[slot].from_children = {};
  t.base.articulated = articulated(t.base.inertia);
  for (int ib = t.num_bundles - 1; ib >= 0; --ib) {
    const Bundle& b = t.bundles[ib];
    ArticulatedInertia<W> rest;
    const int last = b.first_slot + b.length - 1;
    for (int slot = last; slot >= b.first_slot; --slot) {
      LinkState<W>& link = t.links[slot];
      ArticulatedInertia<W> i = slot == last ? articulated(link.inertia) : rest + link.inertia;
      if (t.slots[slot].has_children) i = i + link.from_children;
      const Spatial<W> u = i * link.axis;
      W d = dot(u, link.axis);
      if (extra) d = d + load_lanes(extra, t.slots[slot].joint);
      const W inverse = constant<W>(1) / d;
      rest = without(i, u, u * inverse);
      link.root = sqrt(d);
      link.inv_root = link.root * inverse;
      link.arm = u * link.inv_root;
    }
    add_to_parents<S, ArticulatedInertia>(t, b, rest, t.base.articulated,
                                          &LinkState<W>::from_children);
  }
  if (t.floating) factor_base(t.base);
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
