// Products with the factor L of M = L^T L: generalized forces -> L-space -> velocities, and back.
// In L-space kinetic energy is half a squared norm, and a contact is a row vector Y = J L^-1
// (docs/theory/dynamics.md (D11)-(D15)).
#pragma once
#include "dynamics/factor.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// x = L^-T (tau + base.force + links[].force), into links[].x and base.x. `tau` (num_joints) may
/// be null.
template <class S>
void solve_lower_transposed(Tree<S>& t, const S* tau) {
  WalkInput<S> in;
  in.tau = tau;
  walk<kSolveTransposed>(t, in);
}

template <class S>
STICKSLIP_INLINE S squared_norm_of_base(const Tree<S>& t) {
  S sum = constant<S>(0);
  if (t.floating)
    for (int k = 0; k < 6; ++k) sum = madd(t.base.x[k], t.base.x[k], sum);
  return sum;
}

/// L^-1 x: accelerations (or velocity changes) of the base (6: linear, angular) and the joints.
/// Returns |x|^2, as `squared_norm` does.
template <class S>
S solve_lower(Tree<S>& t, S base[6], S* joints) {
  using W = Wide<S>;
  for (int k = 0; k < 6; ++k) base[k] = t.base.x[k];
  if (t.floating)
    solve_base(t.base, base);
  else
    for (int k = 0; k < 6; ++k) base[k] = constant<S>(0);
  S sum = squared_norm_of_base(t);
  const Spatial<S> of_base = from_rows(base);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> a = from_parents<S, Spatial>(t, b, of_base, &LinkState<W>::acceleration);
    W chain = constant<W>(0);
    blocks_outward(b, [&](int slot, auto n) STICKSLIP_LAMBDA {
      solve_block<decltype(n)::value>(t.links + slot, a, [&](int k, W rate) STICKSLIP_LAMBDA {
        store_lanes<S>(rate, joints, t.slots[slot + k].joint, b);
        chain = madd(t.links[slot + k].x, t.links[slot + k].x, chain);
      });
    });
    const int last = b.first_slot + b.length - 1;
    if (b.has_children) t.links[last].acceleration = a;
    sum = add_lanes<S>(chain, b, sum);
  }
  return sum;
}

/// y = L u into links[].x and base.x, for the velocities that `compute_velocities` or
/// `compute_bias` left in the links.
template <class S>
void multiply_lower(Tree<S>& t, const Vec3<S>& base_velocity, const S* rates) {
  WalkInput<S> in;
  in.linear_velocity = base_velocity, in.rates = rates;
  walk<kMultiply>(t, in);
}

/// compute_velocities, then multiply_lower.
template <class S>
void multiply_lower(Tree<S>& t, const Vec3<S>& angular_velocity, const Vec3<S>& base_velocity,
                    const S* rates) {
  WalkInput<S> in;
  in.angular_velocity = angular_velocity, in.linear_velocity = base_velocity, in.rates = rates;
  walk<kVelocities | kMultiply>(t, in);
}

/// |x|^2 in L-space: twice a kinetic energy when x = L u.
template <class S>
S squared_norm(const Tree<S>& t) {
  using W = Wide<S>;
  S sum = squared_norm_of_base(t);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    W chain = constant<W>(0);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot)
      chain = madd(t.links[slot].x, t.links[slot].x, chain);
    sum = add_lanes<S>(chain, b, sum);
  }
  return sum;
}

/// The six base rows of L^T x: momentum about the base origin (ang) and linear momentum (lin) when
/// x = L u.
template <class S>
Spatial<S> base_momentum(const Tree<S>& t) {
  using W = Wide<S>;
  S rows[6];
  for (int k = 0; k < 6; ++k) {
    rows[k] = t.base.diagonal[k] * t.base.x[k];
    for (int j = k + 1; j < 6; ++j) rows[k] = madd(t.base.factor[j][k], t.base.x[j], rows[k]);
  }
  Spatial<S> sum = from_rows(rows);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> chain = zero_spatial<W>();
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot)
      chain = madd(t.links[slot].arm, t.links[slot].x, chain);
    add_lanes<S, Spatial>(chain, b, sum);
  }
  return sum;
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
