// Builds a Model link by link, as a URDF does. `load_urdf` uses it; so can you, without any file.
#pragma once
#include <stickslip/model.h>

#include <optional>

namespace stickslip {

enum class LinkJointType { kFixed, kRevolute, kContinuous, kPrismatic };

/// A joint as a description gives it, fixed ones included.
struct LinkJoint {
  std::string name;
  LinkJointType type = LinkJointType::kFixed;
  std::string parent;   ///< link name
  std::string child;    ///< link name
  Pose pose;            ///< joint frame in the parent link's frame
  Vector3 axis{1, 0, 0};  ///< in the joint frame; normalized on the way in
  double lower, upper, velocity_limit, effort_limit;  ///< [rad or m], [rad/s or m/s], [N m or N]
  double damping = 0, friction = 0;
  LinkJoint();          ///< limits start infinite
};

/// Collects links, joints and shapes in any order, then checks them all and builds the tree.
class ModelBuilder {
 public:
  explicit ModelBuilder(std::string name, std::string source = "model");
  /// Adds a link; without an inertial it must end up merged into one that has, or be the root of a fixed-base robot.
  void add_link(const std::string& name, std::optional<Inertial> inertial = std::nullopt);
  void add_joint(LinkJoint joint);
  /// Adds a collision shape to a link; `shape.body` is ignored, `shape.pose` is in the link's frame.
  void add_shape(const std::string& link, Shape shape);
  /// Checks everything (names, one root, no loops, finite numbers, positive masses, positive definite inertias that
  /// keep the triangle inequality, unit axes, positive sizes), merges fixed joints, orders the tree. Throws ModelError.
  ModelPtr build(BaseType base) const;

 private:
  struct Link {
    std::string name;
    std::optional<Inertial> inertial;
  };
  std::string name_, source_;
  std::vector<Link> links_;
  std::vector<LinkJoint> joints_;
  std::vector<std::pair<std::string, Shape>> shapes_;
};

}  // namespace stickslip
