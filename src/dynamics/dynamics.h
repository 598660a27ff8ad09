// What a step calls: passes that follow each other in one walk, with the bits of the passes alone.
#pragma once
#include "dynamics/bias.h"
#include "dynamics/solve.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Everything before the contacts of a semi-implicit step: positions, inertias, velocities, factor
/// and x = L^-T (tau - h). The composite inertia is not made, and in packs of environments poses
/// and velocities are those of links that carry something only. Reads all of `in` but the linear
/// velocity.
template <class S>
void compute_free_motion(Tree<S>& t, const WalkInput<S>& in) {
  walk<kPositions | kInertias | kBias | kFactor | kSolveTransposed | kWrenches | kLean>(t, in);
}

/// x = L^-T (-h) with the factor of these positions: compute_bias, then solve_lower_transposed.
template <class S>
void solve_bias(Tree<S>& t, const Vec3<S>& angular_velocity, const S* rates,
                const Vec3<S>& gravity) {
  WalkInput<S> in;
  in.angular_velocity = angular_velocity, in.rates = rates, in.gravity = gravity;
  walk<kBias | kSolveTransposed>(t, in);
}

/// solve_bias at new positions: compute_inertias and factor_mass_matrix before it.
template <class S>
void factor_and_solve_bias(Tree<S>& t, const S* diagonal, const Vec3<S>& angular_velocity,
                           const S* rates, const Vec3<S>& gravity) {
  WalkInput<S> in;
  in.angular_velocity = angular_velocity, in.rates = rates, in.gravity = gravity;
  in.diagonal = diagonal;
  walk<kInertias | kComposite | kBias | kFactor | kSolveTransposed>(t, in);
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
