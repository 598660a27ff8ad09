// Small models and states whose motion is known, for the tests of the step. Nothing here uses libm
// but sqrt, so that states are the same bits everywhere.
#pragma once
#include <stickslip/model_builder.h>
#include <stickslip/world.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace bodies {

using namespace stickslip;

constexpr double kGravity = 9.81;  // [m/s^2]

inline double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline double norm(const Vector3& a) { return std::sqrt(dot(a, a)); }
inline Vector3 operator-(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline std::vector<double> copy(std::span<const double> v) { return {v.begin(), v.end()}; }
inline double largest_difference(std::span<const double> a, std::span<const double> b) {
  double worst = a.size() == b.size() ? 0 : HUGE_VAL;
  for (size_t k = 0; k < a.size(); ++k) worst = std::fmax(worst, std::fabs(a[k] - b[k]));
  return worst;
}
inline double largest(std::span<const double> a) {
  double worst = 0;
  for (double x : a) worst = std::fmax(worst, std::fabs(x));
  return worst;
}
inline bool same_bits(std::span<const double> a, std::span<const double> b) {
  if (a.size() != b.size()) return false;
  return a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

/// Random numbers of splitmix64: integers and one division, no library distribution.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u + 1) {}
  std::uint64_t bits() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  int below(int n) { return static_cast<int>(bits() % static_cast<std::uint64_t>(n)); }
  /// In (-1, 1).
  double uniform() { return (static_cast<double>(bits() >> 11) + 0.5) / 4503599627370496.0 - 1; }
  /// Mean 0, variance 1: a sum of twelve uniform numbers, near enough to normal.
  double normal() {
    double sum = 0;
    for (int k = 0; k < 12; ++k) sum += 0.5 * uniform();
    return sum;
  }
  std::array<double, 4> quaternion() {
    std::array<double, 4> q;
    double square = 0;
    for (double& x : q) x = normal(), square += x * x;
    for (double& x : q) x /= std::sqrt(square);
    return q;
  }

 private:
  std::uint64_t state_;
};

inline Matrix3 rotation(const std::array<double, 4>& q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

// ---- single bodies

inline Inertial inertial(double mass, const Vector3& principal) {
  return {mass, {0, 0, 0}, {principal[0], 0, 0, principal[1], 0, principal[2]}};
}

inline ModelPtr body(const std::string& name, const Inertial& inertial,
                     const std::vector<Shape>& shapes) {
  ModelBuilder builder(name);
  builder.add_link("body", inertial);
  for (const Shape& s : shapes) builder.add_shape("body", s);
  return builder.build(BaseType::kFloating);
}

inline Shape shape(ShapeType type, const Vector3& size, const Vector3& position = {0, 0, 0}) {
  Shape s;
  s.type = type;
  s.size = size;
  s.pose.position = position;
  return s;
}

inline ModelPtr box(const Vector3& size, double mass) {
  const double x = size[0] * size[0], y = size[1] * size[1], z = size[2] * size[2];
  return body("box",
              inertial(mass, {mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y)}),
              {shape(ShapeType::kBox, size)});
}

/// A sphere with inertia k m r^2: 2/5 solid, 2/3 hollow.
inline ModelPtr sphere(double radius, double mass, double k = 0.4) {
  const double i = k * mass * radius * radius;
  return body("sphere", inertial(mass, {i, i, i}), {shape(ShapeType::kSphere, {radius, 0, 0})});
}

/// A solid cylinder or capsule along z; the capsule with a cylinder's inertia.
inline ModelPtr cylinder(double radius, double length, double mass,
                         ShapeType type = ShapeType::kCylinder) {
  const double across = mass * (3 * radius * radius + length * length) / 12;
  return body(type == ShapeType::kCapsule ? "capsule" : "cylinder",
              inertial(mass, {across, across, mass * radius * radius / 2}),
              {shape(type, {radius, length, 0})});
}

/// A thin rod along x with a small sphere at its left end.
inline ModelPtr rod(double length, double mass, double radius) {
  const double i = mass * length * length / 12;
  return body("rod", inertial(mass, {1e-3 * i, i, i}),
              {shape(ShapeType::kSphere, {radius, 0, 0}, {-length / 2, 0, 0})});
}

// ---- jointed models

/// One joint along or about y on a fixed base: the child's center of mass lies `reach` below the
/// joint.
inline ModelPtr one_joint(LinkJointType type, double mass, double reach, double inertia,
                          double damping = 0, const Vector3& axis = {0, 1, 0}) {
  ModelBuilder builder("one_joint");
  builder.add_link("world");
  builder.add_link("link", Inertial{mass, {0, 0, -reach}, {inertia, 0, 0, inertia, 0, inertia}});
  LinkJoint joint;
  joint.name = "joint";
  joint.type = type;
  joint.parent = "world";
  joint.child = "link";
  joint.axis = axis;
  joint.damping = damping;
  builder.add_joint(joint);
  return builder.build(BaseType::kFixed);
}

struct TreeOptions {
  int joints = 8;
  BaseType base = BaseType::kFloating;
  bool prismatic = true;  ///< a quarter of the joints
  bool shapes = false;    ///< one collision shape per link, kinds in turn
  bool chain = false;
  double damping = 0;
};

/// A random tree of links of 0.5 to 3.5 kg, about 0.3 m apart.
inline ModelPtr tree(unsigned seed, const TreeOptions& o) {
  Random random(seed);
  ModelBuilder builder("tree" + std::to_string(seed));
  const auto add_link = [&](const std::string& name) {
    Inertial in;
    in.mass = 2 + 1.5 * random.uniform();
    for (double& c : in.center_of_mass) c = 0.05 * random.uniform();
    const double k = 0.01 * in.mass;
    in.inertia = {k * (1 + 0.2 * random.uniform()), 0.1 * k * random.uniform(),
                  0.1 * k * random.uniform(),       k * (1 + 0.2 * random.uniform()),
                  0.1 * k * random.uniform(),       k * (1 + 0.2 * random.uniform())};
    builder.add_link(name, in);
    if (!o.shapes) return;
    switch (random.below(4)) {
      case 0:
        return builder.add_shape(name, shape(ShapeType::kSphere, {0.08, 0, 0}));
      case 1:
        return builder.add_shape(name, shape(ShapeType::kBox, {0.12, 0.1, 0.08}));
      case 2:
        return builder.add_shape(name, shape(ShapeType::kCapsule, {0.05, 0.1, 0}));
      default:
        return builder.add_shape(name, shape(ShapeType::kCylinder, {0.06, 0.1, 0}));
    }
  };
  add_link("link0");
  for (int j = 0; j < o.joints; ++j) {
    const std::string id = std::to_string(100 + j);  // equal digits: alphabetical is numerical
    add_link("link" + id);
    LinkJoint joint;
    joint.name = "joint" + id;
    joint.child = "link" + id;
    const int parent = o.chain ? j - 1 : random.below(j + 1) - 1;
    joint.parent = parent < 0 ? "link0" : "link" + std::to_string(100 + parent);
    const bool slides = random.below(4) == 0;
    joint.type = o.prismatic && slides ? LinkJointType::kPrismatic : LinkJointType::kRevolute;
    joint.pose.rotation = rotation(random.quaternion());
    for (double& p : joint.pose.position) p = 0.2 * random.uniform();
    for (double& a : joint.axis) a = random.uniform();
    joint.damping = o.damping;
    builder.add_joint(joint);
  }
  return builder.build(o.base);
}

// ---- worlds and states

inline WorldOptions options(double time_step, Integrator integrator = Integrator::kEnergySafe,
                            const Vector3& gravity = {0, 0, -kGravity}) {
  WorldOptions o;
  o.time_step = time_step;
  o.integrator = integrator;
  o.gravity = gravity;
  return o;
}

/// The solver's share of an error must not show.
inline WorldOptions exact(WorldOptions o) {
  o.solver.tolerance = 1e-14;
  o.solver.relative_tolerance = 0;
  return o;
}

constexpr Integrator kBoth[] = {Integrator::kEnergySafe, Integrator::kSemiImplicit};

/// q of a single body or a zeroed robot: base pose, joints 0.
inline std::vector<double> base_at(const Model& m, const Vector3& position,
                                   const std::array<double, 4>& quaternion = {1, 0, 0, 0}) {
  std::vector<double> q(m.nq(), 0.0);
  for (int k = 0; k < 3; ++k) q[k] = position[k];
  for (int k = 0; k < 4; ++k) q[3 + k] = quaternion[k];
  return q;
}

struct State {
  std::vector<double> q, u;
};

/// Random configuration; velocities of `rate` [rad/s or m/s] rms, the base's linear ones 1 m/s.
inline State random_state(const Model& m, std::uint64_t seed, double rate, double height = 0) {
  Random random(seed);
  State s;
  const bool floating = m.base() == BaseType::kFloating;
  s.q = floating ? base_at(m, {0, 0, height}, random.quaternion()) : std::vector<double>(m.nq());
  for (int j = 0; j < m.num_joints(); ++j) {
    const double x = random.uniform();
    s.q[m.nq() - m.num_joints() + j] =
        m.joints()[j].type == JointType::kPrismatic ? 0.1 * x : 1.0 * x;
  }
  s.u.resize(m.nu());
  for (int k = 0; k < m.nu(); ++k) {
    const bool slides =
        k < m.nu() - m.num_joints()
            ? k < 3
            : m.joints()[k - (m.nu() - m.num_joints())].type == JointType::kPrismatic;
    s.u[k] = random.normal() * (slides ? std::fmin(rate, 1.0) : rate);
  }
  return s;
}

}  // namespace bodies
