// Random trees and states for the tests of the kernels.
#pragma once
#include <stickslip/model_builder.h>

#include <cmath>
#include <random>
#include <vector>

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

/// A tree from a list of parents: joint j hangs on the link of joint parents[j], or on the base
/// where that is -1. Some joints are prismatic if asked for.
inline ModelPtr random_tree(unsigned seed, const std::vector<int>& parents, bool prismatic,
                            BaseType base) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  ModelBuilder builder("random");
  builder.add_link("link0", random_inertial(rng));
  for (size_t j = 0; j < parents.size(); ++j) {
    const std::string id = std::to_string(100 + j);  // equal digits: alphabetical is numerical
    builder.add_link("link" + id, random_inertial(rng));
    LinkJoint joint;
    joint.name = "joint" + id;
    joint.child = "link" + id;
    joint.parent = parents[j] < 0 ? "link0" : "link" + std::to_string(100 + parents[j]);
    joint.type = prismatic && rng() % 4 == 0 ? LinkJointType::kPrismatic : LinkJointType::kRevolute;
    joint.pose.rotation = random_rotation(rng);
    for (double& p : joint.pose.position) p = 0.3 * u(rng);
    for (double& a : joint.axis) a = u(rng);
    builder.add_joint(joint);
  }
  return builder.build(base);
}

/// A tree of `joints` joints: `legs` > 0 gives that many equal chains on the base (the last one
/// longer), else a random tree.
inline ModelPtr random_robot(unsigned seed, int joints, int legs, BaseType base) {
  std::mt19937 rng(seed + 1000);
  std::vector<int> parents;
  for (int j = 0; j < joints; ++j)
    parents.push_back(legs > 0 ? (j < legs ? -1 : j - legs)
                               : static_cast<int>(rng() % (j + 1)) - 1);
  return random_tree(seed, parents, legs == 0, base);
}

/// Four legs of seven joints along coordinate axes, frames parallel at zero, as many robots are
/// described; the fifth prismatic, the last along a negative axis. Alike, or every other leg with
/// some axes in another order, and one with a joint at an angle.
inline ModelPtr aligned_legs(unsigned seed, bool alike) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  ModelBuilder builder("aligned");
  builder.add_link("trunk", random_inertial(rng));
  for (int leg = 0; leg < 4; ++leg) {
    const bool other = !alike && leg % 2 == 1;
    const int axes[] = {0, other ? 2 : 1, other ? 2 : 1, 0, 1, 2, 0};
    std::string parent = "trunk";
    for (int k = 0; k < 7; ++k) {
      const std::string id = std::to_string(100 + 10 * leg + k);
      builder.add_link("link" + id, random_inertial(rng));
      LinkJoint joint;
      joint.name = "joint" + id, joint.parent = parent, joint.child = parent = "link" + id;
      joint.type = k == 4 ? LinkJointType::kPrismatic : LinkJointType::kRevolute;
      if (!alike && leg == 3 && k == 5) joint.pose.rotation = random_rotation(rng);
      for (double& p : joint.pose.position) p = 0.3 * u(rng);
      joint.axis = {0, 0, 0};
      joint.axis[axes[k]] = k == 6 ? -1 : 1;
      builder.add_joint(joint);
    }
  }
  return builder.build(BaseType::kFloating);
}

/// A humanoid's topology: two legs of 6 joints, a trunk of 3, on it two arms of 7 and a head of 2.
inline ModelPtr random_humanoid(unsigned seed) {
  std::vector<int> parents;
  const auto add_chain = [&](int on, int length) {
    for (int k = 0; k < length; ++k)
      parents.push_back(k == 0 ? on : static_cast<int>(parents.size()) - 1);
    return static_cast<int>(parents.size()) - 1;
  };
  add_chain(-1, 6), add_chain(-1, 6);
  const int chest = add_chain(-1, 3);
  add_chain(chest, 7), add_chain(chest, 7), add_chain(chest, 2);
  return random_tree(seed, parents, false, BaseType::kFloating);
}

}  // namespace stickslip::testing
