#include "world/state_check.h"

#include <cmath>

#include "step/step_tables.h"

namespace stickslip::world {
namespace {

std::string not_finite(const char* name, const double* values, int n) {
  for (int k = 0; k < n; ++k)
    if (!std::isfinite(values[k]))
      return std::string(name) + "[" + std::to_string(k) + "] is not finite";
  return {};
}

}  // namespace

double quaternion_length(const Model& model, const double* q) {
  if (model.base() == BaseType::kFixed) return 1;
  return std::sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]);
}

std::string state_fault(const Model& model, const double* q, const double* u) {
  if (std::string fault = not_finite("q", q, model.nq()); !fault.empty()) return fault;
  if (std::string fault = not_finite("u", u, model.nu()); !fault.empty()) return fault;
  const double length = quaternion_length(model, q);
  if (std::fabs(length - 1) > step::kQuaternionTolerance)
    return "q[3:7]: the base quaternion (w, x, y, z) has length " + std::to_string(length) +
           "; it must be a unit quaternion";
  const double* joints = q + (model.base() == BaseType::kFloating ? 7 : 0);
  for (int j = 0; j < model.num_joints(); ++j)
    if (std::fabs(joints[j]) > step::kLargestJoint)
      return "q: joint '" + model.joints()[j].name +
             "' is beyond 1e9 rad or m; wrap continuous joints";
  return {};
}

}  // namespace stickslip::world
