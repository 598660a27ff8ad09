// The same robot for MuJoCo: MJCF text with exactly the numbers of a Model.
#pragma once
#include <string>

#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

/// Bodies and joints in the order of Model (MuJoCo keeps it: it is depth first too), one position
/// actuator per joint. Only the ground can be touched; meshes are left out, as stickslip does. No
/// joint limits, dry friction or armature; friction 0.8; everything else is MuJoCo's default.
std::string write_mjcf(const Scenario& scenario);

/// What joint j of Model is called there.
std::string joint_name(int j);

}  // namespace stickslip::benchmarks
