// URDF to Model: our own checks first (urdf_xml.h, for errors that help), then urdfdom reads the
// values, then ModelBuilder.
#include <console_bridge/console.h>
#include <stickslip/errors.h>
#include <stickslip/model_builder.h>
#include <urdf_parser/urdf_parser.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <sstream>

#include "model/pose.h"
#include "model/urdf_xml.h"

namespace stickslip {
namespace {

// Collects what urdfdom would print to the console.
class Capture : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR)
      errors += (errors.empty() ? "" : "; ") + text;
  }
  std::string errors;
};

urdf::ModelInterfaceSharedPtr read_with_urdfdom(const std::string& xml, const std::string& source) {
  // The handler is global to the process: one reader at a time, and it is never destroyed, because
  // console_bridge keeps a pointer to the previous one.
  static std::mutex mutex;
  static Capture& capture = *new Capture;
  const std::lock_guard<std::mutex> lock(mutex);
  capture.errors.clear();
  console_bridge::useOutputHandler(&capture);
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(xml);
  } catch (const std::exception& e) {
    capture.log(e.what(), console_bridge::CONSOLE_BRIDGE_LOG_ERROR, nullptr, 0);
  }
  console_bridge::restorePreviousOutputHandler();
  if (!model)
    throw ModelError(source + ": urdfdom cannot read this description: " + capture.errors);
  return model;
}

Vector3 vector(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

Pose pose(const urdf::Pose& p) {
  const urdf::Rotation& r = p.rotation;
  return {rotation_of_quaternion(r.w, r.x, r.y, r.z), vector(p.position)};
}

Inertial inertial(const urdf::Inertial& from) {
  const Matrix3 R = pose(from.origin).rotation;
  const Matrix3 I = multiply(multiply(R, {from.ixx, from.ixy, from.ixz, from.ixy, from.iyy,
                                          from.iyz, from.ixz, from.iyz, from.izz}),
                             transpose(R));
  return {from.mass, vector(from.origin.position), {I[0], I[1], I[2], I[4], I[5], I[8]}};
}

Shape shape(const urdf::Collision& from) {
  Shape to;
  to.pose = pose(from.origin);
  if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(from.geometry.get())) {
    to.type = ShapeType::kSphere;
    to.size = {sphere->radius, 0, 0};
  } else if (const auto* box = dynamic_cast<const urdf::Box*>(from.geometry.get())) {
    to.type = ShapeType::kBox;
    to.size = vector(box->dim);
  } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(from.geometry.get())) {
    to.type = ShapeType::kCylinder;
    to.size = {cylinder->radius, cylinder->length, 0};
  } else if (const auto* capsule = dynamic_cast<const urdf::Capsule*>(from.geometry.get())) {
    to.type = ShapeType::kCapsule;
    to.size = {capsule->radius, capsule->length, 0};
  } else if (const auto* mesh = dynamic_cast<const urdf::Mesh*>(from.geometry.get())) {
    to.type = ShapeType::kMesh;
    to.mesh_file = mesh->filename;
    to.mesh_scale = vector(mesh->scale);
  }
  return to;
}

LinkJoint joint(const urdf::Joint& from) {
  LinkJoint to;
  to.name = from.name;
  // check_urdf has let only these four through.
  to.type = from.type == urdf::Joint::REVOLUTE     ? LinkJointType::kRevolute
            : from.type == urdf::Joint::CONTINUOUS ? LinkJointType::kContinuous
            : from.type == urdf::Joint::PRISMATIC  ? LinkJointType::kPrismatic
                                                   : LinkJointType::kFixed;
  to.parent = from.parent_link_name;
  to.child = from.child_link_name;
  to.pose = pose(from.parent_to_joint_origin_transform);
  to.axis = vector(from.axis);
  if (from.limits) {
    to.lower = from.limits->lower;
    to.upper = from.limits->upper;
    to.velocity_limit = from.limits->velocity;
    to.effort_limit = from.limits->effort;
  }
  if (from.dynamics) {
    to.damping = from.dynamics->damping;
    to.friction = from.dynamics->friction;
  }
  return to;
}

}  // namespace

ModelPtr parse_urdf(const std::string& xml, BaseType base, const std::string& source) {
  const UrdfText text = check_urdf(xml, source);
  const urdf::ModelInterfaceSharedPtr from = read_with_urdfdom(text.xml, source);
  ModelBuilder builder(text.robot_name, source);
  for (const auto& [element, line] : text.lines) builder.set_line(element, line);
  for (const std::string& warning : text.warnings) builder.add_warning(warning);
  for (const auto& [name, link] : from->links_) {
    builder.add_link(name,
                     link->inertial ? std::optional(inertial(*link->inertial)) : std::nullopt);
    for (const auto& collision : link->collision_array) builder.add_shape(name, shape(*collision));
  }
  for (const auto& named : from->joints_) builder.add_joint(joint(*named.second));
  return builder.build(base);
}

ModelPtr load_urdf(const std::string& path, BaseType base) {
  std::error_code unreadable;
  const std::filesystem::file_status status = std::filesystem::status(path, unreadable);
  if (!std::filesystem::exists(status))
    throw FileError(path + ": there is no such file; check the path (relative paths start at '" +
                    std::filesystem::current_path(unreadable).string() + "')");
  if (std::filesystem::is_directory(status))
    throw FileError(path + ": this is a folder; name the URDF file in it");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream xml;
  if (!file || !(xml << file.rdbuf())) {
    // An empty file also leaves here: inserting nothing is a failure of the stream.
    if (file && file.peek() == std::ifstream::traits_type::eof())
      throw ModelError(path + ": the file is empty");
    throw FileError(path + ": cannot be read: " + std::strerror(errno));
  }
  return parse_urdf(xml.str(), base, path);
}

}  // namespace stickslip
