// From links and joints to a Model: checks, then one walk along the tree that merges fixed joints.
#include <stickslip/errors.h>
#include <stickslip/model_builder.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "model/inertia.h"
#include "model/pose.h"
#include "model/tree.h"

namespace stickslip {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Only a link whose inertia matters is worth a warning: real descriptions give sensor frames
// made-up inertias.
constexpr double kInertiaThatMatters = 1e-2;

template <size_t N>
bool finite(const std::array<double, N>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

// What is wrong with a pose, or empty.
std::string pose_defect(const Pose& pose) {
  if (!finite(pose.position) || !finite(pose.rotation))
    return "its pose has a number that is not finite";
  const Matrix3& R = pose.rotation;
  const Matrix3 P = multiply(R, transpose(R));
  double error = 0;
  for (int k = 0; k < 9; ++k) error = std::max(error, std::fabs(P[k] - (k % 4 == 0 ? 1 : 0)));
  const double determinant = R[0] * (R[4] * R[8] - R[5] * R[7]) -
                             R[1] * (R[3] * R[8] - R[5] * R[6]) +
                             R[2] * (R[3] * R[7] - R[4] * R[6]);
  // 1e-9: rounding of a rotation that was computed, not of one that was typed in with a few digits.
  if (error > 1e-9 || determinant < 0) return "the rotation of its pose is not a rotation matrix";
  return {};
}

JointType moving_type(LinkJointType type) {
  if (type == LinkJointType::kContinuous) return JointType::kContinuous;
  return type == LinkJointType::kPrismatic ? JointType::kPrismatic : JointType::kRevolute;
}

Joint make_joint(const LinkJoint& from, int parent_body, const Pose& pose) {
  Joint to;
  to.name = from.name;
  to.type = moving_type(from.type);
  to.parent_body = parent_body;
  to.pose = pose;
  const double length = norm(from.axis);
  for (int k = 0; k < 3; ++k) to.axis[k] = from.axis[k] / length;
  const bool bounded = to.type != JointType::kContinuous;
  to.lower = bounded ? from.lower : -kInfinity;
  to.upper = bounded ? from.upper : kInfinity;
  to.velocity_limit = from.velocity_limit;
  to.effort_limit = from.effort_limit;
  to.damping = from.damping;
  to.friction = from.friction;
  return to;
}

}  // namespace

LinkJoint::LinkJoint()
    : lower(-kInfinity), upper(kInfinity), velocity_limit(kInfinity), effort_limit(kInfinity) {}

ModelBuilder::ModelBuilder(std::string name, std::string source)
    : name_(std::move(name)), source_(std::move(source)) {}

void ModelBuilder::add_link(const std::string& name, std::optional<Inertial> inertial) {
  links_.push_back({name, inertial});
}

void ModelBuilder::add_joint(LinkJoint joint) { joints_.push_back(std::move(joint)); }

void ModelBuilder::add_shape(const std::string& link, Shape shape) {
  shapes_.emplace_back(link, std::move(shape));
}

void ModelBuilder::add_warning(std::string text) { warnings_.push_back(std::move(text)); }

void ModelBuilder::set_line(const std::string& element, int line) { lines_[element] = line; }

void ModelBuilder::fail(const std::string& element, const std::string& what) const {
  const auto line = lines_.find(element);
  const std::string place = line == lines_.end() ? "" : ":" + std::to_string(line->second);
  throw ModelError(source_ + place + ": " + element + ": " + what);
}

void ModelBuilder::check_link(const Link& link) const {
  if (!link.inertial) return;
  const std::string element = link_named(link.name);
  const Inertial& inertial = *link.inertial;
  if (!std::isfinite(inertial.mass) || !finite(inertial.center_of_mass) ||
      !finite(inertial.inertia))
    fail(element, "its mass, center of mass or inertia has a number that is not finite");
  if (inertial.mass < 0)
    fail(element, "its mass is " + number(inertial.mass) + " kg; a mass cannot be negative");
}

void ModelBuilder::check_joint(const LinkJoint& joint) const {
  const std::string element = joint_named(joint.name);
  if (const std::string defect = pose_defect(joint.pose); !defect.empty()) fail(element, defect);
  if (joint.type == LinkJointType::kFixed) return;
  if (!finite(joint.axis)) fail(element, "its axis has a number that is not finite");
  // 1e-6: an axis this short carries no direction that anybody meant.
  if (norm(joint.axis) < 1e-6)
    fail(element, "its axis is zero; give the direction it turns about or slides along");
  if (std::isnan(joint.lower) || std::isnan(joint.upper))
    fail(element, "a position limit is not a number");
  if (joint.type != LinkJointType::kContinuous && joint.lower > joint.upper)
    fail(element, "its lower limit " + number(joint.lower) + " exceeds its upper limit " +
                      number(joint.upper));
  const std::pair<const char*, double> limits[] = {{"velocity limit", joint.velocity_limit},
                                                   {"effort limit", joint.effort_limit}};
  for (const auto& [what, value] : limits)
    if (!(value >= 0))
      fail(element,
           std::string("its ") + what + " is " + number(value) + "; it must be zero or more");
  const std::pair<const char*, double> losses[] = {{"damping", joint.damping},
                                                   {"friction", joint.friction}};
  for (const auto& [what, value] : losses)
    if (!(value >= 0) || !std::isfinite(value))
      fail(element, std::string("its ") + what + " is " + number(value) +
                        "; it must be finite and zero or more");
}

void ModelBuilder::check_shape(const std::string& link, const Shape& shape) const {
  const std::string element = link_named(link);
  const auto known = [&](const Link& l) { return l.name == link; };
  if (std::none_of(links_.begin(), links_.end(), known))
    fail(element, "a shape is on this link, which does not exist");
  if (const std::string defect = pose_defect(shape.pose); !defect.empty())
    fail(element, "a shape of it: " + defect);
  if (shape.type == ShapeType::kMesh) {
    if (shape.mesh_file.empty()) fail(element, "a mesh of it names no file");
    for (double scale : shape.mesh_scale)
      if (!std::isfinite(scale) || scale == 0)
        fail(element, "the scale of a mesh of it must be finite and not zero");
    return;
  }
  const int numbers = shape.type == ShapeType::kBox ? 3 : shape.type == ShapeType::kSphere ? 1 : 2;
  for (int k = 0; k < numbers; ++k)
    if (!(shape.size[k] > 0) || !std::isfinite(shape.size[k]))
      fail(element, "a shape of it has the size " + number(shape.size[k]) +
                        " m; sizes must be finite and positive");
}

// Shapes move along with their link, in the order in which it got them.
void ModelBuilder::place_shapes(Model& model, const Frame& frame) const {
  int index = 0;
  for (const auto& [link, given] : shapes_) {
    if (link != frame.name) continue;
    Shape shape = given;
    if (shape.name.empty()) shape.name = link + "/" + std::to_string(index);
    shape.body = frame.body;
    shape.pose = compose(frame.pose, given.pose);
    model.shapes_.push_back(shape);
    ++index;
  }
}

void ModelBuilder::merge_inertials(Model& model) const {
  std::vector<std::vector<Inertial>> parts(model.bodies_.size());
  std::vector<std::vector<const Link*>> links(model.bodies_.size());
  for (const Frame& frame : model.frames_) {
    const auto link = std::find_if(links_.begin(), links_.end(),
                                   [&](const Link& l) { return l.name == frame.name; });
    if (!link->inertial) continue;
    parts[frame.body].push_back(transform(frame.pose, *link->inertial));
    links[frame.body].push_back(&*link);
  }
  for (size_t b = 0; b < model.bodies_.size(); ++b) {
    Body& body = model.bodies_[b];
    body.inertial = merge(parts[b]);
    if (b == 0 && model.base_ == BaseType::kFixed) continue;  // it never moves
    const std::string mover =
        b == 0 ? "the floating base"
               : "the body that joint '" + model.joints_[body.joint].name + "' moves";
    if (!(body.inertial.mass > 0))
      fail(link_named(body.name),
           mover +
               " has no mass, so no force has a defined effect on it; give this link or one "
               "that is fixed to it an <inertial> with a positive mass" +
               (b == 0 ? std::string(", or load the robot with a fixed base") : std::string()));
    const std::string defect = inertia_defect(body.inertial.inertia);
    // The link to blame: the first whose own inertia is impossible, else the one that moves.
    std::string culprit = body.name;
    for (size_t k = links[b].size(); k-- > 0;) {
      const std::string own = inertia_defect(parts[b][k].inertia);
      const Vector3 moments = principal_moments(parts[b][k].inertia);
      if (own.empty() || (moments[0] == 0 && moments[2] == 0))
        continue;  // a mere frame changes nothing
      if (!defect.empty())
        culprit = links[b][k]->name;
      else if (moments[2] > kInertiaThatMatters * principal_moments(body.inertial.inertia)[0])
        model.warnings_.push_back(link_named(links[b][k]->name) + ": its inertia " + own +
                                  "; kept, because body '" + body.name + "' as a whole is sound");
    }
    if (!defect.empty())
      fail(link_named(culprit), "the inertia of " + mover + " (link '" + body.name +
                                    "' and what is fixed to it) " + defect +
                                    "; correct the <inertia> of this link");
  }
}

ModelPtr ModelBuilder::build(BaseType base) const {
  std::vector<std::string> names;
  for (const Link& link : links_) names.push_back(link.name);
  const LinkTree tree = make_tree(
      names, joints_,
      [this](const std::string& element, const std::string& what) { fail(element, what); });
  for (const Link& link : links_) check_link(link);
  for (const LinkJoint& joint : joints_) check_joint(joint);
  for (const auto& [link, shape] : shapes_) check_shape(link, shape);

  std::shared_ptr<Model> model(new Model);
  model->name_ = name_;
  model->base_ = base;
  model->warnings_ = warnings_;

  // One walk from the root: a moving joint starts a body, a fixed one adds its link to the parent's
  // body.
  std::vector<int> frame_of(links_.size());
  for (int l : tree.order) {
    Frame frame{links_[l].name, 0, {}};
    if (tree.parent_joint[l] < 0) {
      model->bodies_.push_back({frame.name, -1, {}});
    } else {
      const LinkJoint& joint = joints_[tree.parent_joint[l]];
      const Frame& parent = model->frames_[frame_of[tree.parent_link[l]]];
      const Pose pose = compose(parent.pose, joint.pose);
      if (joint.type == LinkJointType::kFixed) {
        frame.body = parent.body;
        frame.pose = pose;
      } else {
        frame.body = static_cast<int>(model->bodies_.size());
        model->bodies_.push_back({frame.name, model->num_joints(), {}});
        model->joints_.push_back(make_joint(joint, parent.body, pose));
      }
    }
    // Huge offsets may overflow only where they add up.
    const Pose& placed = frame.body > 0 ? model->joints_[frame.body - 1].pose : frame.pose;
    if (!finite(placed.position) || !finite(frame.pose.position))
      fail(link_named(frame.name), "its position overflows");
    frame_of[l] = static_cast<int>(model->frames_.size());
    model->frames_.push_back(frame);
    place_shapes(*model, frame);
  }
  merge_inertials(*model);
  return model;
}

}  // namespace stickslip
