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
  WalkInput<S> in;
  in.angular_velocity = angular_velocity, in.rates = rates, in.gravity = gravity;
  walk<kBias>(t, in);
}

/// Generalized forces of the link forces, summed toward the base: joints into `out` (num_joints),
/// the whole into base.force.
template <class S>
void collect_joint_forces(Tree<S>& t, S* out) {
  using W = Wide<S>;
  clear_sums<kSolveTransposed>(t);
  for (int ib = t.num_bundles - 1; ib >= 0; --ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> f = zero_spatial<W>();
    const int last = b.first_slot + b.length - 1;
    for (int slot = last; slot >= b.first_slot; --slot) {
      f = f + t.links[slot].force;
      if (slot == last && b.has_children) f = f + t.links[slot].force_from_children;
      store_lanes<S>(dot(f, t.links[slot].axis), out, t.slots[slot].joint, b);
    }
    add_to_parents<S, Spatial>(t, b, f, t.base.force, &LinkState<W>::force_from_children);
  }
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
