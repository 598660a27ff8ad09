// Products with the factor L of M = L^T L: generalized forces -> L-space -> velocities, and back.
// In L-space kinetic energy is half a squared norm, and a contact is a row vector Y = J L^-1
// (docs/theory/dynamics.md (D11)-(D15)).
#pragma once
#include "dynamics/factor.h"

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

/// Which forces besides the joint forces act in `solve_lower_transposed`.
enum class LinkForces { kNone, kBaseOnly, kAll };

/// x = L^-T (tau + forces on links), into links[].x and base.x. `tau` (num_joints) may be null;
/// `forces` says whether base.force and links[].force take part.
template <class S>
void solve_lower_transposed(Tree<S>& t, const S* tau, LinkForces forces) {
  using W = Wide<S>;
  for (int slot = 0; slot < t.num_slots; ++slot)
    if (t.slots[slot].has_children) t.links[slot].force_from_children = {};
  Spatial<S> on_base = forces != LinkForces::kNone ? t.base.force : zero_spatial<S>();
  for (int ib = t.num_bundles - 1; ib >= 0; --ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> f = zero_spatial<W>();
    for (int slot = b.first_slot + b.length - 1; slot >= b.first_slot; --slot) {
      LinkState<W>& link = t.links[slot];
      if (forces == LinkForces::kAll) f = f + link.force;
      if (t.slots[slot].has_children) f = f + link.force_from_children;
      W on_joint = dot(f, link.axis);
      if (tau) on_joint = on_joint + load_lanes(tau, t.slots[slot].joint);
      link.x = on_joint * link.inv_root;
      f = nmadd(link.arm, link.x, f);
    }
    add_to_parents<S, Spatial>(t, b, f, on_base, &LinkState<W>::force_from_children);
  }
  to_rows(on_base, t.base.x);
  if (t.floating) solve_base_transposed(t.base, t.base.x);
}

/// L^-1 x: accelerations (or velocity changes) of the base (6: linear, angular) and the joints.
template <class S>
void solve_lower(Tree<S>& t, S base[6], S* joints) {
  using W = Wide<S>;
  for (int k = 0; k < 6; ++k) base[k] = t.base.x[k];
  if (t.floating)
    solve_base(t.base, base);
  else
    for (int k = 0; k < 6; ++k) base[k] = constant<S>(0);
  const Spatial<S> of_base = from_rows(base);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> a = from_parents<S, Spatial>(t, b, of_base, &LinkState<W>::acceleration);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
      LinkState<W>& link = t.links[slot];
      const W rate = (link.x - dot(link.arm, a)) * link.inv_root;
      store_lanes<S>(rate, joints, t.slots[slot].joint, b.lanes);
      a = madd(link.axis, rate, a);
      link.acceleration = a;
    }
  }
}

/// y = L u into links[].x and base.x, for the velocities that `compute_velocities` or
/// `compute_bias` left in the links.
template <class S>
void multiply_lower(Tree<S>& t, const Vec3<S>& base_velocity, const S* rates) {
  using W = Wide<S>;
  const Vec3<W> translation{W(base_velocity.x), W(base_velocity.y), W(base_velocity.z)};
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
      LinkState<W>& link = t.links[slot];
      const W from_parent = dot(link.arm.ang, v.ang) + dot(link.arm.lin, v.lin + translation);
      link.x = madd(link.root, load_lanes(rates, t.slots[slot].joint), from_parent);
      v = link.velocity;
    }
  }
  if (!t.floating) return;
  S u[6];
  to_rows(Spatial<S>{t.base.velocity.ang, base_velocity}, u);
  for (int j = 0; j < 6; ++j) {
    t.base.x[j] = t.base.diagonal[j] * u[j];
    for (int k = 0; k < j; ++k) t.base.x[j] = madd(t.base.factor[j][k], u[k], t.base.x[j]);
  }
}

/// |x|^2 in L-space: twice a kinetic energy when x = L u.
template <class S>
S squared_norm(const Tree<S>& t) {
  using W = Wide<S>;
  S sum = constant<S>(0);
  if (t.floating)
    for (int k = 0; k < 6; ++k) sum = madd(t.base.x[k], t.base.x[k], sum);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    W chain = constant<W>(0);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot)
      chain = madd(t.links[slot].x, t.links[slot].x, chain);
    for (int lane = 0; lane < b.lanes; ++lane) sum = sum + lane_of<S>(chain, lane);
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
    auto* to = reinterpret_cast<S*>(&sum);
    const auto* from = reinterpret_cast<const W*>(&chain);
    for (int k = 0; k < kNumbersIn<S, Spatial>; ++k)
      for (int lane = 0; lane < b.lanes; ++lane) to[k] = to[k] + lane_of<S>(from[k], lane);
  }
  return sum;
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
