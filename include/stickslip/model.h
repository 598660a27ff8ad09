// The immutable description of one robot: a tree of rigid bodies, its joints, frames and collision
// shapes. Plain double data in URDF conventions; the kernels derive their own layout from it
// (src/layout/tree_layout.h).
#pragma once
#include <array>
#include <memory>
#include <string>
#include <vector>

namespace stickslip {

/// x, y, z.
using Vector3 = std::array<double, 3>;
/// Row-major rotation matrix.
using Matrix3 = std::array<double, 9>;

/// Pose of frame B in frame A: `p_A = rotation * p_B + position`, position in [m].
struct Pose {
  Matrix3 rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 position{0, 0, 0};
};

/// Mass properties of one body in its body frame.
struct Inertial {
  double mass = 0;                  ///< [kg]
  Vector3 center_of_mass{0, 0, 0};  ///< [m]
  std::array<double, 6> inertia{0, 0, 0,
                                0, 0, 0};  ///< xx xy xz yy yz zz about the center of mass [kg m^2]
};

/// Whether body 0 moves freely or is part of the world.
enum class BaseType { kFloating, kFixed };
/// What a moving joint does; kContinuous is a revolute joint without position limits.
enum class JointType { kRevolute, kContinuous, kPrismatic };
/// Kinds of collision shapes; a kMesh is kept as a reference and makes no contact.
enum class ShapeType { kSphere, kBox, kCylinder, kCapsule, kMesh };

/// One moving joint. Joint `j` carries body `j + 1`.
struct Joint {
  std::string name;
  JointType type = JointType::kRevolute;
  int parent_body =
      0;      ///< index of the body the joint hangs on; always smaller than the child's index
  Pose pose;  ///< joint frame (= child body frame at q = 0) in the parent body frame
  Vector3 axis{0, 0, 1};      ///< unit axis in the joint frame
  double lower = 0;           ///< position limit [rad or m]; -inf where the joint has none
  double upper = 0;           ///< position limit [rad or m]; +inf where the joint has none
  double velocity_limit = 0;  ///< [rad/s or m/s]; +inf where the joint has none
  double effort_limit = 0;    ///< [N m or N]; +inf where the joint has none
  double damping = 0;         ///< viscous [N m s/rad or N s/m]
  double friction =
      0;  ///< dry friction of the description [N m or N]; read and kept, not simulated yet
};

/// One rigid body: a URDF link with everything merged that is fixed to it.
struct Body {
  std::string name;
  int joint = -1;  ///< index of the joint that carries it; -1 for body 0
  Inertial inertial;
};

/// A named frame fixed to a body. Every URDF link is one, merged ones too.
struct Frame {
  std::string name;
  int body = 0;
  Pose pose;  ///< in the body frame
};

/// A collision shape fixed to a body.
struct Shape {
  std::string
      name;  ///< name of the URDF link it was given with, and its index there, as in "LF_FOOT/0"
  ShapeType type = ShapeType::kSphere;
  int body = 0;
  Pose pose;  ///< shape frame in the body frame
  /// Box: full side lengths; sphere: {radius}; cylinder, capsule: {radius, length}, along z,
  /// without the caps [m].
  Vector3 size{0, 0, 0};
  std::string mesh_file;  ///< mesh: file reference as written in the description
  Vector3 mesh_scale{1, 1, 1};
  std::string material;  ///< contact material; empty: the robot's
};

/// A robot. Immutable: made by `ModelBuilder::build` or `load_urdf`, shared by every world that
/// holds it.
///
/// Generalized position `q`: floating base position (3) [m], base quaternion w x y z (4), joints
/// [rad or m]; a fixed base has the joints only. Generalized velocity `u`: base linear velocity (3)
/// [m/s] and angular velocity (3) [rad/s], both of the base origin in world axes, then joint rates.
/// Joints are in depth-first order, siblings by name. Joints that mimic another in a URDF are
/// independent here, as Pinocchio's are by default; `warnings` names them.
class Model {
 public:
  const std::string& name() const { return name_; }
  BaseType base() const { return base_; }
  const std::vector<Body>& bodies() const { return bodies_; }  ///< body 0 is the base
  const std::vector<Joint>& joints() const { return joints_; }
  const std::vector<Frame>& frames() const { return frames_; }
  const std::vector<Shape>& shapes() const { return shapes_; }
  /// What was accepted although it looks wrong, or read but not followed; one sentence each, naming
  /// the element.
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Moving joints.
  int num_joints() const { return static_cast<int>(joints_.size()); }
  /// Length of q.
  int nq() const { return num_joints() + (base_ == BaseType::kFloating ? 7 : 0); }
  /// Length of u.
  int nu() const { return num_joints() + (base_ == BaseType::kFloating ? 6 : 0); }
  double mass() const;  ///< of all bodies; of a fixed base, without body 0 [kg]

  int joint_index(const std::string& name) const;     ///< throws ModelError that lists the names
  int body_index(const std::string& name) const;      ///< throws ModelError that lists the names
  const Frame& frame(const std::string& name) const;  ///< throws ModelError that lists the names

 private:
  friend class ModelBuilder;
  Model() = default;
  std::string name_;
  BaseType base_ = BaseType::kFloating;
  std::vector<Body> bodies_;
  std::vector<Joint> joints_;
  std::vector<Frame> frames_;
  std::vector<Shape> shapes_;
  std::vector<std::string> warnings_;
};

/// Models are shared: every robot made from one holds it.
using ModelPtr = std::shared_ptr<const Model>;

/// Reads a robot from a URDF file. Fixed joints are merged into their parents, and their links stay
/// as frames. Throws FileError or ModelError (names the file, the element and what to do).
ModelPtr load_urdf(const std::string& path, BaseType base = BaseType::kFloating);

/// Reads a robot from URDF text; `source` is what errors call it. Throws ModelError.
ModelPtr parse_urdf(const std::string& xml, BaseType base = BaseType::kFloating,
                    const std::string& source = "<string>");

}  // namespace stickslip
