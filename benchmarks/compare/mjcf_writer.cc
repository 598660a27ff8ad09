#include "benchmarks/compare/mjcf_writer.h"

#include <cmath>
#include <cstdio>
#include <initializer_list>

namespace stickslip::benchmarks {
namespace {

std::string numbers(std::initializer_list<double> values) {
  std::string out;
  for (const double x : values) {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", x);
    if (!out.empty()) out += ' ';
    out += text;
  }
  return out;
}

std::string numbers(const Vector3& v) { return numbers({v[0], v[1], v[2]}); }

/// Unit quaternion w x y z of a rotation matrix; the largest component is found first, so that no
/// division is by something small.
std::array<double, 4> quaternion(const Matrix3& r) {
  const double t[4] = {1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8], 1 - r[0] + r[4] - r[8],
                       1 - r[0] - r[4] + r[8]};
  int k = 0;
  for (int i = 1; i < 4; ++i)
    if (t[i] > t[k]) k = i;
  const double s = 2 * std::sqrt(t[k]);
  const double wx = r[7] - r[5], wy = r[2] - r[6], wz = r[3] - r[1];
  const double xy = r[1] + r[3], xz = r[2] + r[6], yz = r[5] + r[7];
  switch (k) {
    case 0:
      return {s / 4, wx / s, wy / s, wz / s};
    case 1:
      return {wx / s, s / 4, xy / s, xz / s};
    case 2:
      return {wy / s, xy / s, s / 4, yz / s};
    default:
      return {wz / s, xz / s, yz / s, s / 4};
  }
}

std::string pose(const Pose& p) {
  const auto q = quaternion(p.rotation);
  return "pos=\"" + numbers(p.position) + "\" quat=\"" + numbers({q[0], q[1], q[2], q[3]}) + "\"";
}

std::string geom(const Shape& s) {
  std::string kind;
  switch (s.type) {
    case ShapeType::kSphere:
      kind = "type=\"sphere\" size=\"" + numbers({s.size[0]}) + "\"";
      break;
    case ShapeType::kBox:
      kind = "type=\"box\" size=\"" + numbers({s.size[0] / 2, s.size[1] / 2, s.size[2] / 2}) + "\"";
      break;
    case ShapeType::kCylinder:
      kind = "type=\"cylinder\" size=\"" + numbers({s.size[0], s.size[1] / 2}) + "\"";
      break;
    case ShapeType::kCapsule:
      kind = "type=\"capsule\" size=\"" + numbers({s.size[0], s.size[1] / 2}) + "\"";
      break;
    case ShapeType::kMesh:
      return "";
  }
  return "<geom " + kind + " " + pose(s.pose) + " contype=\"0\" conaffinity=\"1\"/>\n";
}

std::string inertial(const Inertial& i) {
  if (!(i.mass > 0)) return "";  // base of a fixed robot
  const auto& m = i.inertia;     // xx xy xz yy yz zz; MuJoCo wants the diagonal first
  return "<inertial pos=\"" + numbers(i.center_of_mass) + "\" mass=\"" + numbers({i.mass}) +
         "\" fullinertia=\"" + numbers({m[0], m[3], m[5], m[1], m[2], m[4]}) + "\"/>\n";
}

std::string body(const Model& model, int index) {
  std::string out = "<body name=\"b" + std::to_string(index) + "\" ";
  if (index == 0) {
    out += ">\n";
    if (model.base() == BaseType::kFloating) out += "<freejoint/>\n";
  } else {
    const Joint& j = model.joints()[index - 1];
    out += pose(j.pose) + ">\n<joint name=\"" + joint_name(index - 1) + "\" type=\"" +
           (j.type == JointType::kPrismatic ? "slide" : "hinge") + "\" axis=\"" + numbers(j.axis) +
           "\" damping=\"" + numbers({j.damping}) + "\"/>\n";
  }
  out += inertial(model.bodies()[index].inertial);
  for (const Shape& s : model.shapes())
    if (s.body == index) out += geom(s);
  for (int j = 0; j < model.num_joints(); ++j)
    if (model.joints()[j].parent_body == index) out += body(model, j + 1);
  return out + "</body>\n";
}

}  // namespace

std::string joint_name(int j) {
  std::string name = "j";
  return name += std::to_string(j);
}

std::string write_mjcf(const Scenario& s) {
  const Model& model = *s.model;
  std::string out =
      "<mujoco>\n<compiler angle=\"radian\" autolimits=\"false\" inertiafromgeom=\"false\"/>\n"
      "<option timestep=\"" +
      numbers({kTimeStep}) +
      "\" gravity=\"0 0 -9.81\" cone=\"elliptic\" solver=\"Newton\"/>\n"
      "<default><geom friction=\"0.8 0 0\" condim=\"3\"/></default>\n<worldbody>\n";
  if (s.ground) out += "<geom type=\"plane\" size=\"0 0 1\" contype=\"1\" conaffinity=\"0\"/>\n";
  out += body(model, 0) + "</worldbody>\n<actuator>\n";
  for (int j = 0; j < model.num_joints(); ++j)
    out += "<position joint=\"" + joint_name(j) + "\" kp=\"" + numbers({s.kp[j]}) + "\" kv=\"" +
           numbers({s.kd[j]}) + "\"/>\n";
  return out + "</actuator>\n</mujoco>\n";
}

}  // namespace stickslip::benchmarks
