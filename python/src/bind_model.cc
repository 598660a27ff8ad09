// Python face of Model, ModelBuilder and the URDF reader. Arrays come back as numpy copies: a Model
// never changes.
#include <nanobind/stl/array.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <stickslip/errors.h>
#include <stickslip/model.h>
#include <stickslip/model_builder.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "bindings.h"
#include "model/pose.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stickslip::python {
namespace {

ArrayOut to_numpy(const double* values, std::initializer_list<std::size_t> shape) {
  return make_array(shape,
                    [&](std::span<double> to) { std::copy_n(values, to.size(), to.begin()); });
}

ArrayOut vector3(const Vector3& v) { return to_numpy(v.data(), {3}); }
ArrayOut matrix3(const Matrix3& m) { return to_numpy(m.data(), {3, 3}); }
ArrayOut inertia_matrix(const Inertial& inertial) {
  const auto& I = inertial.inertia;
  return matrix3({I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5]});
}

template <class Items>
std::vector<std::string> names(const Items& items) {
  std::vector<std::string> all;
  for (const auto& item : items) all.push_back(item.name);
  return all;
}

// One number of every joint, as an array.
ArrayOut joint_values(const Model& model, double Joint::* value) {
  std::vector<double> all;
  for (const Joint& joint : model.joints()) all.push_back(joint.*value);
  return copy_array(all);
}

BaseType base_type(const std::string& name) {
  if (name == "floating") return BaseType::kFloating;
  if (name == "fixed") return BaseType::kFixed;
  throw ModelError("base is '" + name + "'; use 'floating' or 'fixed'");
}

const char* name_of(JointType type) {
  if (type == JointType::kRevolute) return "revolute";
  return type == JointType::kContinuous ? "continuous" : "prismatic";
}

LinkJointType link_joint_type(const std::string& name) {
  if (name == "fixed") return LinkJointType::kFixed;
  if (name == "revolute") return LinkJointType::kRevolute;
  if (name == "continuous") return LinkJointType::kContinuous;
  if (name == "prismatic") return LinkJointType::kPrismatic;
  throw ModelError("joint type '" + name +
                   "' is unknown; use 'fixed', 'revolute', 'continuous' or 'prismatic'");
}

constexpr const char* kShapeNames[] = {"sphere", "box", "cylinder", "capsule", "mesh"};

ShapeType shape_type(const std::string& name) {
  for (int k = 0; k < 5; ++k)
    if (name == kShapeNames[k]) return static_cast<ShapeType>(k);
  throw ModelError("shape type '" + name +
                   "' is unknown; use 'sphere', 'box', 'cylinder', 'capsule' or 'mesh'");
}

// Pose from a position and a quaternion w x y z, normalized on the way in.
Pose make_pose(const Vector3& position, const std::array<double, 4>& q) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 1e-6) || !std::isfinite(length))
    throw ModelError("orientation is not a quaternion w x y z: its length is " +
                     std::to_string(length));
  return {rotation_of_quaternion(q[0] / length, q[1] / length, q[2] / length, q[3] / length),
          position};
}

void bind_parts(nb::module_& m) {
  nb::class_<Pose>(m, "Pose", "Pose of frame B in frame A: p_A = rotation @ p_B + position.")
      .def_prop_ro(
          "position", [](const Pose& p) { return vector3(p.position); }, nb::rv_policy::move,
          "(3,) [m]")
      .def_prop_ro(
          "rotation", [](const Pose& p) { return matrix3(p.rotation); }, nb::rv_policy::move,
          "(3, 3) rotation matrix");

  nb::class_<Body>(m, "Body", "One rigid body: a link with everything merged that is fixed to it.")
      .def_ro("name", &Body::name)
      .def_ro("joint", &Body::joint, "Index of the joint that carries it; -1 for body 0.")
      .def_prop_ro(
          "mass", [](const Body& b) { return b.inertial.mass; }, "[kg]")
      .def_prop_ro(
          "center_of_mass", [](const Body& b) { return vector3(b.inertial.center_of_mass); },
          nb::rv_policy::move, "(3,) in the body frame [m]")
      .def_prop_ro(
          "inertia", [](const Body& b) { return inertia_matrix(b.inertial); }, nb::rv_policy::move,
          "(3, 3) about the center of mass, in body axes [kg m^2]")
      .def("__repr__", [](const Body& b) { return "<Body '" + b.name + "'>"; });

  nb::class_<Joint>(m, "Joint", "One moving joint. Joint j carries body j + 1.")
      .def_ro("name", &Joint::name)
      .def_prop_ro(
          "type", [](const Joint& j) { return name_of(j.type); },
          "'revolute', 'continuous' or 'prismatic'")
      .def_ro("parent_body", &Joint::parent_body, "Index of the body the joint hangs on.")
      .def_ro("pose", &Joint::pose, "Joint frame in the parent body frame.")
      .def_prop_ro(
          "axis", [](const Joint& j) { return vector3(j.axis); }, nb::rv_policy::move,
          "(3,) unit axis in the joint frame")
      .def_ro("lower", &Joint::lower, "[rad or m]; -inf where the joint has none")
      .def_ro("upper", &Joint::upper, "[rad or m]; +inf where the joint has none")
      .def_ro("velocity_limit", &Joint::velocity_limit,
              "[rad/s or m/s]; +inf where the joint has none")
      .def_ro("effort_limit", &Joint::effort_limit, "[N m or N]; +inf where the joint has none")
      .def_ro("damping", &Joint::damping, "Viscous [N m s/rad or N s/m].")
      .def_ro("friction", &Joint::friction,
              "Dry friction [N m or N]; read and kept, not simulated yet.")
      .def("__repr__",
           [](const Joint& j) { return "<Joint '" + j.name + "', " + name_of(j.type) + ">"; });

  nb::class_<Frame>(m, "Frame",
                    "A named frame fixed to a body. Every URDF link is one, merged ones too.")
      .def_ro("name", &Frame::name)
      .def_ro("body", &Frame::body, "Index of the body it is fixed to.")
      .def_ro("pose", &Frame::pose, "In the body frame.")
      .def("__repr__", [](const Frame& f) { return "<Frame '" + f.name + "'>"; });

  nb::class_<Shape>(m, "Shape", "A collision shape fixed to a body.")
      .def_ro("name", &Shape::name, "Name of its link and its index there, as in 'LF_FOOT/0'.")
      .def_prop_ro(
          "type", [](const Shape& s) { return kShapeNames[static_cast<int>(s.type)]; },
          "'sphere', 'box', 'cylinder', 'capsule' or 'mesh'")
      .def_ro("body", &Shape::body, "Index of the body it is fixed to.")
      .def_ro("pose", &Shape::pose, "In the body frame.")
      .def_prop_ro(
          "size", [](const Shape& s) { return vector3(s.size); }, nb::rv_policy::move,
          "(3,) box: side lengths; sphere: radius; cylinder, capsule: radius, length without the "
          "caps [m]")
      .def_ro("mesh_file", &Shape::mesh_file, "Mesh: file reference as written in the description.")
      .def_prop_ro(
          "mesh_scale", [](const Shape& s) { return vector3(s.mesh_scale); }, nb::rv_policy::move,
          "(3,)")
      .def_ro("material", &Shape::material, "Contact material; empty: the robot's.")
      .def("__repr__", [](const Shape& s) {
        return "<Shape '" + s.name + "', " + kShapeNames[static_cast<int>(s.type)] + ">";
      });
}

void bind_model_class(nb::module_& m) {
  nb::class_<Model>(m, "Model",
                    "The immutable description of one robot: a tree of rigid bodies, joints, "
                    "frames and shapes.\n\n"
                    "q of a floating base: position (3) [m], quaternion w x y z (4), joints [rad "
                    "or m]; u: linear and\n"
                    "angular velocity of the base origin in world axes, joint rates. A fixed base "
                    "has the joints only.\n"
                    "Joints are in depth-first order, siblings by name. Joints that mimic another "
                    "are independent.")
      .def_prop_ro("name", &Model::name, "As the description gives it.")
      .def_prop_ro(
          "base",
          [](const Model& self) { return self.base() == BaseType::kFixed ? "fixed" : "floating"; },
          "'floating' or 'fixed'")
      .def_prop_ro("bodies", &Model::bodies, "Body 0 is the base; body j + 1 hangs on joint j.")
      .def_prop_ro("joints", &Model::joints,
                   "Moving joints, depth first, siblings by name: the order of q and u.")
      .def_prop_ro("frames", &Model::frames, "One per link of the description, merged ones too.")
      .def_prop_ro("shapes", &Model::shapes, "Collision shapes, meshes too.")
      .def_prop_ro("warnings", &Model::warnings,
                   "What was accepted although it looks wrong, or read but not followed.")
      .def_prop_ro("num_joints", &Model::num_joints, "Moving joints.")
      .def_prop_ro("nq", &Model::nq, "Length of the generalized position.")
      .def_prop_ro("nu", &Model::nu, "Length of the generalized velocity.")
      .def_prop_ro("mass", &Model::mass, "Of all bodies; of a fixed base, without body 0 [kg].")
      .def_prop_ro(
          "body_names", [](const Model& self) { return names(self.bodies()); },
          "In the order of `bodies`.")
      .def_prop_ro(
          "joint_names", [](const Model& self) { return names(self.joints()); },
          "In the order of q and u.")
      .def_prop_ro(
          "frame_names", [](const Model& self) { return names(self.frames()); },
          "In the order of `frames`.")
      .def_prop_ro(
          "lower", [](const Model& self) { return joint_values(self, &Joint::lower); },
          nb::rv_policy::move, "(num_joints,) [rad or m]")
      .def_prop_ro(
          "upper", [](const Model& self) { return joint_values(self, &Joint::upper); },
          nb::rv_policy::move, "(num_joints,) [rad or m]")
      .def_prop_ro(
          "velocity_limit",
          [](const Model& self) { return joint_values(self, &Joint::velocity_limit); },
          nb::rv_policy::move, "(num_joints,) [rad/s or m/s]")
      .def_prop_ro(
          "effort_limit",
          [](const Model& self) { return joint_values(self, &Joint::effort_limit); },
          nb::rv_policy::move, "(num_joints,) [N m or N]")
      .def("joint_index", &Model::joint_index, "name"_a, "Raises ModelError that lists the names.")
      .def("body_index", &Model::body_index, "name"_a, "Raises ModelError that lists the names.")
      .def("frame", &Model::frame, "name"_a, nb::rv_policy::reference_internal,
           "Raises ModelError that lists the names.")
      .def("__repr__", [](const Model& self) {
        return "<Model '" + self.name() + "', " + std::to_string(self.bodies().size()) +
               " bodies, " + std::to_string(self.num_joints()) + " joints>";
      });

  m.def(
      "load_urdf",
      [](const std::filesystem::path& path, const std::string& base) {
        return load_urdf(path.string(), base_type(base));
      },
      "path"_a, "base"_a = "floating",
      "Reads a robot from a URDF file. Fixed joints are merged into their parents; their links "
      "stay as frames.\n\n"
      "Raises FileNotFoundError or ModelError, which name the file, the element and what to do.");
  m.def(
      "parse_urdf",
      [](const std::string& xml, const std::string& base, const std::string& source) {
        return parse_urdf(xml, base_type(base), source);
      },
      "xml"_a, "base"_a = "floating", "source"_a = "<string>",
      "Reads a robot from URDF text; source is what errors call it.");
}

void add_link(ModelBuilder& self, const std::string& name, std::optional<double> mass,
              const Vector3& center_of_mass, const std::optional<std::array<Vector3, 3>>& inertia) {
  if (!mass && !inertia) return self.add_link(name);
  if (!mass || !inertia)
    throw ModelError("link '" + name + "': give both mass and inertia, or neither");
  const auto& I = *inertia;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < r; ++c)
      if (!(std::fabs(I[r][c] - I[c][r]) <= 1e-9 * (std::fabs(I[r][r]) + std::fabs(I[c][c]))))
        throw ModelError("link '" + name + "': inertia[" + std::to_string(r) + "][" +
                         std::to_string(c) +
                         "] differs from its mirror image; an inertia is symmetric");
  self.add_link(
      name,
      Inertial{*mass, center_of_mass, {I[0][0], I[0][1], I[0][2], I[1][1], I[1][2], I[2][2]}});
}

void bind_builder(nb::module_& m) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Vector3 zero{0, 0, 0};
  const std::array<double, 4> upright{1, 0, 0, 0};
  nb::class_<ModelBuilder>(
      m, "ModelBuilder",
      "Collects links, joints and shapes in any order, then checks them all and builds the tree.")
      .def(nb::init<std::string, std::string>(), "name"_a, "source"_a = "model")
      .def("add_link", &add_link, "name"_a, "mass"_a = nb::none(), "center_of_mass"_a = zero,
           "inertia"_a = nb::none(),
           "Adds a link. mass [kg], center_of_mass (3) [m], inertia (3, 3) about it in link axes "
           "[kg m^2].")
      .def(
          "add_joint",
          [](ModelBuilder& self, const std::string& name, const std::string& type,
             const std::string& parent, const std::string& child, const Vector3& position,
             const std::array<double, 4>& orientation, const Vector3& axis, double lower,
             double upper, double velocity_limit, double effort_limit, double damping,
             double friction) {
            LinkJoint joint;
            joint.name = name;
            joint.type = link_joint_type(type);
            joint.parent = parent;
            joint.child = child;
            joint.pose = make_pose(position, orientation);
            joint.axis = axis;
            joint.lower = lower;
            joint.upper = upper;
            joint.velocity_limit = velocity_limit;
            joint.effort_limit = effort_limit;
            joint.damping = damping;
            joint.friction = friction;
            self.add_joint(joint);
          },
          "name"_a, "type"_a, "parent"_a, "child"_a, "position"_a = zero, "orientation"_a = upright,
          "axis"_a = Vector3{1, 0, 0}, "lower"_a = -kInfinity, "upper"_a = kInfinity,
          "velocity_limit"_a = kInfinity, "effort_limit"_a = kInfinity, "damping"_a = 0.0,
          "friction"_a = 0.0,
          "Adds a joint: type 'fixed', 'revolute', 'continuous' or 'prismatic'; position (3) [m] "
          "and orientation\n"
          "(w x y z) in the parent link; limits [rad or m], [rad/s or m/s], [N m or N].")
      .def(
          "add_shape",
          [](ModelBuilder& self, const std::string& link, const std::string& type,
             const std::vector<double>& size, const Vector3& position,
             const std::array<double, 4>& orientation, const std::string& material,
             const std::string& mesh_file, const Vector3& mesh_scale) {
            Shape shape;
            shape.type = shape_type(type);
            const size_t numbers = type == "mesh"     ? 0
                                   : type == "sphere" ? 1
                                   : type == "box"    ? 3
                                                      : 2;
            if (size.size() != numbers)
              throw ModelError("link '" + link + "': size of a " + type + " has " +
                               std::to_string(numbers) + " numbers, not " +
                               std::to_string(size.size()));
            std::copy(size.begin(), size.end(), shape.size.begin());
            shape.pose = make_pose(position, orientation);
            shape.material = material;
            shape.mesh_file = mesh_file;
            shape.mesh_scale = mesh_scale;
            self.add_shape(link, shape);
          },
          "link"_a, "type"_a, "size"_a = std::vector<double>{}, "position"_a = zero,
          "orientation"_a = upright, "material"_a = "", "mesh_file"_a = "",
          "mesh_scale"_a = Vector3{1, 1, 1},
          "Adds a collision shape to a link. size [m]: box (x, y, z), sphere (radius,), cylinder "
          "and capsule\n"
          "(radius, length).")
      .def(
          "build",
          [](const ModelBuilder& self, const std::string& base) {
            return self.build(base_type(base));
          },
          "base"_a = "floating",
          "Checks everything, merges fixed joints, orders the tree. Raises ModelError.");
}

}  // namespace

void bind_model(nb::module_& m) {
  // A class of its own, so that callers can tell an unusable description from other bad values.
  const nb::exception<ModelError> error(m, "ModelError", PyExc_ValueError);
  error.attr("__module__") = "stickslip";
  error.attr("__doc__") =
      "A description, a model or a problem is not usable; the text names the file, the element or "
      "the argument.";
  bind_parts(m);
  bind_model_class(m);
  bind_builder(m);
}

}  // namespace stickslip::python
