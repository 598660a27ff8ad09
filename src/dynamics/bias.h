// Bias force h of M du/dt + h = tau by the recursive Newton-Euler algorithm [Featherstone 2008,
// sec. 5.3], outward half: the force each link needs for zero joint accelerations. Uniform
// translation of the base does not enter (docs/theory/dynamics.md (D2), (D6)).
#pragma once
#include "dynamics/kinematics.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Sets every link's `force` to minus its inertial and gravity load at velocity (angular_velocity,
/// rates), so that `solve_lower_transposed` turns it into L^-T (-h). Also leaves the link
/// velocities. gravity [m/s^2], world axes.
template <class S>
void compute_bias(Tree<S>& t, const Vec3<S>& angular_velocity, const S* rates,
                  const Vec3<S>& gravity) {
  using W = Wide<S>;
  t.base.velocity = {angular_velocity, zero3<S>()};
  t.base.acceleration = {zero3<S>(), -gravity};
  const Spatial<S> base_momentum = t.base.inertia * t.base.velocity;
  t.base.force = -cross_force(t.base.velocity, base_momentum, t.base.inertia * t.base.acceleration);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
    Spatial<W> a = from_parents<S, Spatial>(t, b, t.base.acceleration, &LinkState<W>::acceleration);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
      LinkState<W>& link = t.links[slot];
      const Spatial<W> joint = link.axis * load_lanes(rates, t.slots[slot].joint);
      v = v + joint;
      a = a + cross_motion(v, joint);
      link.velocity = v;
      link.acceleration = a;
      link.force = -cross_force(v, link.inertia * v, link.inertia * a);
    }
  }
}

/// Generalized forces of the link forces, summed toward the base: joints into `out` (num_joints),
/// the whole into base.force.
template <class S>
void collect_joint_forces(Tree<S>& t, S* out) {
  using W = Wide<S>;
  for (int slot = 0; slot < t.num_slots; ++slot)
    if (t.slots[slot].has_children) t.links[slot].force_from_children = {};
  for (int ib = t.num_bundles - 1; ib >= 0; --ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> f = zero_spatial<W>();
    for (int slot = b.first_slot + b.length - 1; slot >= b.first_slot; --slot) {
      f = f + t.links[slot].force;
      if (t.slots[slot].has_children) f = f + t.links[slot].force_from_children;
      store_lanes<S>(dot(f, t.links[slot].axis), out, t.slots[slot].joint, b.lanes);
    }
    add_to_parents<S, Spatial>(t, b, f, t.base.force, &LinkState<W>::force_from_children);
  }
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
