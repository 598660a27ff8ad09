// A chain whose last links touch the ground with two balls each.
#pragma once
#include "step/bodies.h"

namespace bodies {

inline constexpr int kLinks = 7;

/// A chain of short rods with two balls on each of its last three; `interleaved`: the second ball
/// of each is on a frame fixed to it that comes after the next rods, so a model lists the shapes of
/// a body apart.
inline ModelPtr chain(BaseType base, bool interleaved) {
  ModelBuilder builder("chain");
  Inertial in;
  in.mass = 0.5;
  in.inertia = {2e-3, 0, 0, 2e-3, 0, 2e-3};
  builder.add_link("link0", in);
  for (int k = 1; k <= kLinks; ++k) {
    const std::string id = std::to_string(k), link = "link" + id;
    builder.add_link(link, in);
    LinkJoint joint;
    joint.name = "joint" + id;
    joint.type = LinkJointType::kRevolute;
    joint.parent = "link" + std::to_string(k - 1);
    joint.child = link;
    joint.pose.position = {0.12, 0, 0};
    joint.axis = k % 2 ? Vector3{0, 1, 0} : Vector3{0.3, 0.2, 1};
    builder.add_joint(joint);
    if (k <= kLinks - 3) continue;
    Shape ball;
    ball.size = {0.03, 0, 0};
    ball.pose.position = {0.05, -0.05, 0};
    builder.add_shape(link, ball);
    ball.pose.position = {0.05, 0.05, 0};
    if (interleaved) {
      builder.add_link("side" + id);
      LinkJoint fixed;
      fixed.name = "side_joint" + id;
      fixed.type = LinkJointType::kFixed;
      fixed.parent = link;
      fixed.child = "side" + id;
      builder.add_joint(fixed);
    }
    builder.add_shape(interleaved ? "side" + id : link, ball);
  }
  return builder.build(base);
}

}  // namespace bodies
