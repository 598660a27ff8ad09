// Leg kinematics written out for ANYmal's geometry (assets/anymal_b). No libm: results have the
// same bits everywhere.
#include "scenes/anymal.h"

#include <stickslip/model_builder.h>

#include <set>

#include "scenes/vector.h"

namespace stickslip::scenes {
namespace {

// One link of the left front leg; other legs mirror x (hind) and y (right).
struct Link {
  double mass;     // [kg]
  Vector3 center;  // of mass, link frame [m]
  Vector3
      inertia;  // xx yy zz about the center of mass [kg m^2]; products are below 2 % and left out
};
constexpr Link kLinks[3] = {
    {1.42462064, {0.064516, -0.003787, -0.000152}, {0.002430, 0.002303, 0.001981}},
    {1.634976467, {-0.003898, 0.054227, -0.214583}, {0.012037, 0.012064, 0.002494}},
    {0.348375069, {0.058852, -0.010851, -0.098705}, {0.006908, 0.007756, 0.001022}},
};
constexpr Vector3 kHip{0.277, 0.116, 0}, kThigh{0.0635, 0.041, 0}, kShank{0, 0.109, -0.25};
constexpr Vector3 kFoot{0.1, -0.02, -0.298};

// Columns axis_j x (point - origin_j) of the joints 0..last that move the point.
Matrix3 point_jacobian(const Vector3* axes, const Vector3* origins, const Vector3& point,
                       int last) {
  Matrix3 jacobian{};
  for (int j = 0; j <= last; ++j) {
    const Vector3 column = cross(axes[j], point - origins[j]);
    for (int i = 0; i < 3; ++i) jacobian[3 * i + j] = column[i];
  }
  return jacobian;
}

}  // namespace

Matrix3 rotation_of(std::span<const double, 4> p) {
  const double w = p[0], x = p[1], y = p[2], z = p[3];
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

LegState leg_state(int leg, std::span<const double> q, std::span<const double> u) {
  const double fore = leg == 1 || leg == 3 ? -1 : 1, left = leg >= 2 ? -1 : 1;
  const auto mirror = [&](const Vector3& p) { return Vector3{fore * p[0], left * p[1], p[2]}; };
  const double* angle = &q[7 + 3 * leg];
  const Vector3 rate{u[6 + 3 * leg], u[7 + 3 * leg], u[8 + 3 * leg]};

  // link frames, joint origins and axes, from the base outwards
  const Matrix3 base = rotation_of(q.subspan(3).first<4>());
  Matrix3 frames[3];
  Vector3 origins[3], axes[3];
  origins[0] = base * mirror(kHip);
  frames[0] = base * rotation(0, angle[0]);
  origins[1] = origins[0] + frames[0] * mirror(kThigh);
  frames[1] = frames[0] * rotation(1, angle[1]);
  origins[2] = origins[1] + frames[1] * mirror(kShank);
  frames[2] = frames[0] * rotation(1, angle[1] + angle[2]);
  axes[0] = {base[0], base[3], base[6]};
  axes[1] = axes[2] = {frames[0][1], frames[0][4], frames[0][7]};

  LegState s{};
  s.foot = origins[2] + frames[2] * mirror(kFoot);
  const Vector3 lowest = s.foot - Vector3{0, 0, kFootRadius};
  s.foot_jacobian = point_jacobian(axes, origins, s.foot, 2);
  s.contact_jacobian = point_jacobian(axes, origins, lowest, 2);
  const Vector3 velocity{u[0], u[1], u[2]}, spin{u[3], u[4], u[5]};
  s.foot_velocity = velocity + cross(spin, s.foot) + s.foot_jacobian * rate;
  s.contact_velocity = velocity + cross(spin, lowest) + s.contact_jacobian * rate;

  // M = sum of m Jc' Jc + Jw' I Jw, weight = sum of m g Jc'z over the links
  for (int k = 0; k < 3; ++k) {
    const Link& link = kLinks[k];
    const Vector3 center = origins[k] + frames[k] * mirror(link.center);
    const Matrix3 jc = point_jacobian(axes, origins, center, k);
    for (int i = 0; i <= k; ++i) {
      s.gravity_torque[i] += link.mass * kGravity * jc[6 + i];
      const Vector3 wi = transposed_times(frames[k], axes[i]);
      for (int j = 0; j <= k; ++j) {
        const Vector3 wj = transposed_times(frames[k], axes[j]);
        double m = 0;
        for (int r = 0; r < 3; ++r)
          m += link.mass * jc[3 * r + i] * jc[3 * r + j] + wi[r] * link.inertia[r] * wj[r];
        s.inertia[3 * i + j] += m;
      }
    }
  }
  return s;
}

ModelPtr without_base_shapes(const Model& model) {
  ModelBuilder builder(model.name());
  std::set<std::string> links;
  for (const Body& body : model.bodies()) {
    builder.add_link(body.name, body.inertial);
    links.insert(body.name);
  }
  for (size_t j = 0; j < model.joints().size(); ++j) {
    const Joint& from = model.joints()[j];
    LinkJoint to;
    to.name = from.name;
    to.type = from.type == JointType::kRevolute     ? LinkJointType::kRevolute
              : from.type == JointType::kContinuous ? LinkJointType::kContinuous
                                                    : LinkJointType::kPrismatic;
    to.parent = model.bodies()[from.parent_body].name;
    to.child = model.bodies()[j + 1].name;
    to.pose = from.pose;
    to.axis = from.axis;
    to.lower = from.lower;
    to.upper = from.upper;
    to.velocity_limit = from.velocity_limit;
    to.effort_limit = from.effort_limit;
    to.damping = from.damping;
    to.friction = from.friction;
    builder.add_joint(to);
  }
  // merged links come back as massless ones, so that their frames stay
  for (const Frame& frame : model.frames()) {
    if (!links.insert(frame.name).second) continue;
    builder.add_link(frame.name);
    LinkJoint fixed;
    fixed.name = frame.name + "_fixed";
    fixed.type = LinkJointType::kFixed;
    fixed.parent = model.bodies()[frame.body].name;
    fixed.child = frame.name;
    fixed.pose = frame.pose;
    builder.add_joint(fixed);
  }
  for (const Shape& shape : model.shapes())
    if (shape.body != 0) builder.add_shape(model.bodies()[shape.body].name, shape);
  return builder.build(model.base());
}

}  // namespace stickslip::scenes
