// Random trees and states for the tests of the kernels.
#pragma once
#include <stickslip/model_builder.h>

#include <cmath>
#include <random>

namespace stickslip::testing {

inline Matrix3 random_rotation(std::mt19937& rng) {
  std::normal_distribution<double> n;
  double w = n(rng), x = n(rng), y = n(rng), z = n(rng);
  const double s = 1 / std::sqrt(w * w + x * x + y * y + z * z);
  w *= s, x *= s, y *= s, z *= s;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

inline Inertial random_inertial(std::mt19937& rng) {
  std::uniform_real_distribution<double> u(-1, 1);
  Inertial in;
  in.mass = 2 + 1.8 * u(rng);
  for (double& c : in.center_of_mass) c = 0.1 * u(rng);
  const double k = in.mass * 0.01;
  in.inertia = {k * (1 + 0.2 * u(rng)), 0.1 * k * u(rng), 0.1 * k * u(rng),
                k * (1 + 0.2 * u(rng)), 0.1 * k * u(rng), k * (1 + 0.2 * u(rng))};
  return in;
}

/// A tree of `joints` joints: `legs` > 0 gives that many equal chains on the base (the last one
/// longer), else a random tree.
inline ModelPtr random_robot(unsigned seed, int joints, int legs, BaseType base) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  ModelBuilder builder("random");
  builder.add_link("link0", random_inertial(rng));
  for (int j = 0; j < joints; ++j) {
    const std::string id = std::to_string(100 + j);  // equal digits: alphabetical is numerical
    builder.add_link("link" + id, random_inertial(rng));
    LinkJoint joint;
    joint.name = "joint" + id;
    joint.child = "link" + id;
    const int parent =
        legs > 0 ? (j < legs ? -1 : j - legs) : static_cast<int>(rng() % (j + 1)) - 1;
    joint.parent = parent < 0 ? "link0" : "link" + std::to_string(100 + parent);
    joint.type = legs == 0 && rng() % 4 == 0 ? LinkJointType::kPrismatic : LinkJointType::kRevolute;
    joint.pose.rotation = random_rotation(rng);
    for (double& p : joint.pose.position) p = 0.3 * u(rng);
    for (double& a : joint.axis) a = u(rng);
    builder.add_joint(joint);
  }
  return builder.build(base);
}

}  // namespace stickslip::testing
