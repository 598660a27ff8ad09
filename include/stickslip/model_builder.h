// Builds a Model link by link, as a URDF does. `load_urdf` uses it; so can you, without any file.
#pragma once
#include <stickslip/model.h>

#include <map>
#include <optional>

namespace stickslip {

/// Joint types of a description.
enum class LinkJointType { kFixed, kRevolute, kContinuous, kPrismatic };

/// A joint as a description gives it, fixed ones included.
struct LinkJoint {
  std::string name;
  LinkJointType type = LinkJointType::kFixed;
  std::string parent;     ///< link name
  std::string child;      ///< link name
  Pose pose;              ///< joint frame in the parent link's frame
  Vector3 axis{1, 0, 0};  ///< in the joint frame; normalized on the way in
  double lower, upper, velocity_limit, effort_limit;  ///< [rad or m], [rad/s or m/s], [N m or N]
  double damping = 0, friction = 0;  ///< viscous [N m s/rad or N s/m], dry [N m or N]
  LinkJoint();                       ///< limits start infinite
};

/// Collects links, joints and shapes in any order, then checks them all and builds the tree.
class ModelBuilder {
 public:
  /// `source` is what errors call the description, a file name for instance.
  explicit ModelBuilder(std::string name, std::string source = "model");
  /// Adds a link; without an inertial it must end up merged into one that has, or into the root of
  /// a fixed-base robot.
  void add_link(const std::string& name, std::optional<Inertial> inertial = std::nullopt);
  /// Adds a joint; its links may come later.
  void add_joint(LinkJoint joint);
  /// Adds a collision shape to a link; `shape.body` is ignored, `shape.pose` is in the link's
  /// frame. An empty `shape.name` becomes the link's name and the shape's index there.
  void add_shape(const std::string& link, Shape shape);
  /// Passed on to `Model::warnings`.
  void add_warning(std::string text);
  /// Says where the source speaks of an element, called as in "link 'torso'" or "joint 'knee'";
  /// errors then name the line.
  void set_line(const std::string& element, int line);
  /// Checks everything (names, one root, no loops, finite numbers, positive masses, positive
  /// definite inertias that keep the triangle inequality, unit axes, positive sizes), merges fixed
  /// joints, orders the tree. Throws ModelError.
  ///
  /// Masses and inertias are judged by what moves: one body with all links that are fixed to it.
  /// Body 0 of a fixed base needs none. src/model/inertia.h has the tolerances.
  ModelPtr build(BaseType base) const;

 private:
  struct Link {
    std::string name;
    std::optional<Inertial> inertial;
  };
  [[noreturn]] void fail(const std::string& element, const std::string& what) const;
  void check_link(const Link& link) const;
  void check_joint(const LinkJoint& joint) const;
  void check_shape(const std::string& link, const Shape& shape) const;
  void place_shapes(Model& model, const Frame& frame) const;
  void merge_inertials(Model& model) const;

  std::string name_, source_;
  std::vector<Link> links_;
  std::vector<LinkJoint> joints_;
  std::vector<std::pair<std::string, Shape>> shapes_;
  std::vector<std::string> warnings_;
  std::map<std::string, int> lines_;
};

}  // namespace stickslip
