// Facts of ANYmal B that the controller and the tasks need, and the kinematics of its legs.
//
// Joint order as in stickslip::Model: legs LF, LH, RF, RH; per leg HAA (axis x), HFE, KFE (axis y).
#pragma once
#include <stickslip/model.h>

#include <array>
#include <span>

#include "scenes/constants.h"

namespace stickslip::scenes {

inline constexpr int kNumLegs = 4;
inline constexpr int kNumJoints = 12;
inline constexpr double kFootRadius = 0.031;   ///< [m]
inline constexpr double kTotalMass = 30.4754;  ///< [kg]

/// Position of our leg (LF LH RF RH) in the order LF RF LH RH, which the generated MuJoCo model
/// uses; its own inverse.
inline constexpr std::array<int, kNumLegs> kPeerLeg{0, 2, 1, 3};

/// Joint angles of the stance that the tasks start from [rad].
inline constexpr std::array<double, kNumJoints> kStance{0, 0.4, -0.8, 0, -0.4, 0.8,
                                                        0, 0.4, -0.8, 0, -0.4, 0.8};

/// One leg at a state of the robot. Vectors in world axes, positions from the base origin.
struct LegState {
  Vector3 foot;              ///< center of the foot sphere [m]
  Vector3 foot_velocity;     ///< of the center [m/s]
  Vector3 contact_velocity;  ///< of the material point that is lowest on the sphere [m/s]
  Matrix3
      foot_jacobian;  ///< joint rates to velocity of the center relative to the base, row-major [m]
  Matrix3 contact_jacobian;  ///< the same for the lowest point [m]
  Matrix3 inertia;           ///< joint-space inertia with the base held, row-major [kg m^2]
  Vector3 gravity_torque;    ///< joint torques that hold the leg's own weight [N m]
};

/// Rotation matrix (row-major) of a unit quaternion w x y z.
Matrix3 rotation_of(std::span<const double, 4> quaternion);

/// State of leg `leg` at the robot state q (19), u (18), in the conventions of Model.
LegState leg_state(int leg, std::span<const double> q, std::span<const double> u);

/// The same robot without the collision shapes of its base: only the feet can touch anything.
/// Frames are kept.
ModelPtr without_base_shapes(const Model& model);

}  // namespace stickslip::scenes
