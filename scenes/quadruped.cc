#include "scenes/quadruped.h"

#include <cmath>

namespace stickslip::scenes {
namespace {

constexpr double kTorsoMass = 18.5;                    // [kg]
constexpr Vector3 kTorsoInertia{0.25, 0.75, 0.85};     // [kg m^2]
constexpr Vector3 kTorsoHalf{0.27, 0.13, 0.12};        // [m]
constexpr double kLinkMass[3] = {1.4, 1.8, 0.5};       // [kg]
constexpr double kLinkLength[3] = {0.11, 0.25, 0.32};  // [m]

/// Adds Q^T diag(principal) Q with Q = axes^T `angular`: a body's inertia in the mass matrix.
void add_inertia(std::array<QuadrupedRow, kQuadrupedDofs>& M, const Matrix3& axes,
                 const Vector3& principal, const PointRows& angular) {
  for (int k = 0; k < 3; ++k) {
    QuadrupedRow row{};
    for (int i = 0; i < 3; ++i)
      for (int x = 0; x < kQuadrupedDofs; ++x) row[x] += axes[3 * i + k] * angular[i][x];
    for (int x = 0; x < kQuadrupedDofs; ++x)
      for (int y = 0; y < kQuadrupedDofs; ++y) M[x][y] += principal[k] * row[x] * row[y];
  }
}

}  // namespace

// Axes and origins of a leg's joints, relative to the torso's center.
struct Quadruped::Leg {
  int index = 0;
  Vector3 axis[3], origin[3];

  PointRows linear(const Vector3& p, int joints) const {
    PointRows rows{};
    for (int i = 0; i < 3; ++i) {
      rows[i][i] = 1;
      Vector3 unit{};
      unit[i] = 1;
      const Vector3 turn = cross(unit, p);
      for (int r = 0; r < 3; ++r) rows[r][3 + i] = turn[r];
    }
    for (int j = 0; j < joints; ++j) {
      const Vector3 turn = cross(axis[j], p - origin[j]);
      for (int r = 0; r < 3; ++r) rows[r][6 + 3 * index + j] = turn[r];
    }
    return rows;
  }
  PointRows angular(int joints) const {
    PointRows rows{};
    for (int i = 0; i < 3; ++i) rows[i][3 + i] = 1;
    for (int j = 0; j < joints; ++j)
      for (int r = 0; r < 3; ++r) rows[r][6 + 3 * index + j] = axis[j][r];
    return rows;
  }
};

void Quadruped::add_link(double mass, double length, const Vector3& center, const Matrix3& axes,
                         const Leg& leg, int joints) {
  const PointRows linear = leg.linear(center, joints);
  for (int x = 0; x < kQuadrupedDofs; ++x)
    for (int y = 0; y < kQuadrupedDofs; ++y)
      for (int i = 0; i < 3; ++i) mass_matrix[x][y] += mass * linear[i][x] * linear[i][y];
  const double rod = mass * length * length / 12 + 3e-3;
  add_inertia(mass_matrix, axes, {rod, rod, 2e-3}, leg.angular(joints));
}

void Quadruped::add_leg(int index, const Matrix3& base, const Vector3& q) {
  const double fore = index < 2 ? 1 : -1, left = index % 2 ? -1 : 1;
  Leg leg;
  leg.index = index;
  Matrix3 axes = base;
  Vector3 p = base * Vector3{fore * 0.28, left * 0.12, 0};
  for (int j = 0; j < 3; ++j) {
    const int about = j == 0 ? 0 : 1;
    axes = axes * rotation(about, q[j]);
    leg.axis[j] = column(axes, about), leg.origin[j] = p;
    const Vector3 along =
        axes * (j == 0 ? Vector3{0, left * kLinkLength[0], 0} : Vector3{0, 0, -kLinkLength[j]});
    add_link(kLinkMass[j], kLinkLength[j], p + (j == 0 ? 0.5 : 0.3) * along, axes, leg, j + 1);
    p = p + along;
  }
  feet[index] = leg.linear(p, 3);
  for (int s = 0; s < 4; ++s)
    soles[index][s] = leg.linear(p + Vector3{s & 1 ? 0.08 : -0.08, s & 2 ? 0.04 : -0.04, 0}, 3);
}

Quadruped::Quadruped(Random& rng, double tilt) {
  const double roll = rng.uniform(-tilt, tilt), pitch = rng.uniform(-tilt, tilt);
  const Matrix3 base = rotation(0, roll) * rotation(1, pitch);
  const Leg none{};
  for (int i = 0; i < 3; ++i) mass_matrix[i][i] = kTorsoMass;
  add_inertia(mass_matrix, base, kTorsoInertia, none.angular(0));
  for (int leg = 0; leg < 4; ++leg) {
    Vector3 q;
    q[0] = rng.uniform(-0.5, 0.5);
    q[1] = rng.sign() * rng.uniform(0.1, 1.2);
    q[2] = rng.sign() * rng.uniform(0.3, 2.2);
    add_leg(leg, base, q);
  }
  for (int c = 0; c < 8; ++c)
    corners[c] = none.linear(base * Vector3{c & 1 ? kTorsoHalf[0] : -kTorsoHalf[0],
                                            c & 2 ? kTorsoHalf[1] : -kTorsoHalf[1],
                                            c & 4 ? kTorsoHalf[2] : -kTorsoHalf[2]},
                             0);
}

QuadrupedFactor::QuadrupedFactor(const Quadruped& robot) : l_(robot.mass_matrix) {
  for (int j = kQuadrupedDofs - 1; j >= 0; --j) {
    l_[j][j] = std::sqrt(l_[j][j]);
    for (int k = 0; k < j; ++k) l_[j][k] /= l_[j][j];
    for (int k = 0; k < j; ++k)
      for (int i = 0; i <= k; ++i) l_[k][i] -= l_[j][k] * l_[j][i];
  }
}

QuadrupedRow QuadrupedFactor::project(QuadrupedRow row) const {
  for (int j = kQuadrupedDofs - 1; j >= 0; --j) {
    row[j] /= l_[j][j];
    for (int k = 0; k < j; ++k) row[k] -= row[j] * l_[j][k];
  }
  return row;
}

QuadrupedRow QuadrupedFactor::times(const QuadrupedRow& u) const {
  QuadrupedRow x{};
  for (int j = 0; j < kQuadrupedDofs; ++j)
    for (int k = 0; k <= j; ++k) x[j] += l_[j][k] * u[k];
  return x;
}

const char* scene_name(int scene) {
  static const char* const kNames[] = {
      "stand, 4 feet", "trot, 2 to 4 feet",   "impact, 4 feet",         "rest, 4 feet + 4 corners",
      "drop, 4 + 4",   "drop, 4 + 8 corners", "two soles of 4 contacts"};
  return kNames[scene];
}

namespace {

/// Velocities and torques before the step.
struct Motion {
  double speed;    // standard deviation of all of u [m/s, rad/s]
  double forward;  // [m/s]
  double fall;     // [m/s]
  double torque;   // standard deviation of the joint torques [N m]
};
constexpr Motion kMotions[kNumScenes] = {{1e-3, 0, 0, 15}, {0.3, 1.5, 0, 20}, {2, 0, 3, 0},
                                         {1e-2, 0, 0, 10}, {2, 0, 3, 0},      {2, 0, 3, 0},
                                         {2, 0, 3, 0}};

/// x = L u after a step of free motion: L (u + dt g) + dt L^-T tau.
QuadrupedRow free_motion(const Motion& motion, const QuadrupedFactor& factor, Random& rng) {
  QuadrupedRow u, tau{};
  for (double& x : u) x = motion.speed * rng.normal();
  u[0] += motion.forward, u[2] -= motion.fall + kGravity * kProblemStep;
  if (motion.torque > 0)
    for (int j = 6; j < kQuadrupedDofs; ++j) tau[j] = kProblemStep * motion.torque * rng.normal();
  QuadrupedRow x = factor.times(u);
  const QuadrupedRow kick = factor.project(tau);
  for (int k = 0; k < kQuadrupedDofs; ++k) x[k] += kick[k];
  return x;
}

/// Feet of a trot: a diagonal pair, three of them, all.
constexpr int kTrotFeet[4][5] = {{2, 0, 3}, {2, 1, 2}, {3, 0, 1, 3}, {4, 0, 1, 2, 3}};

}  // namespace

RobotProblem random_robot_problem(int scene, Random& rng) {
  const Quadruped robot(rng);
  const QuadrupedFactor factor(robot);
  RobotProblem p;
  p.soles = scene == kSoles;
  p.m = p.soles ? 12 : 6;
  const PointRows* points[12];
  const auto add = [&](const PointRows& rows, int leg) {
    points[p.n] = &rows, p.leg[p.n] = leg;
    ++p.n;
  };
  if (p.soles) {
    for (int i = 0; i < 8; ++i) add(robot.soles[i / 4][i % 4], i / 4);
  } else {
    const int* feet = kTrotFeet[scene == kTrot ? rng.below(4) : 3];
    for (int i = 1; i <= feet[0]; ++i) add(robot.feet[feet[i]], feet[i]);
    const int corners = scene == kDropTwelve                         ? 8
                        : scene == kRestEight || scene == kDropEight ? 4
                                                                     : 0;
    for (int c = 0; c < corners; ++c) add(robot.corners[c], -1);
  }
  const QuadrupedRow x = free_motion(kMotions[scene], factor, rng);
  p.mu = rng.uniform(0.3, 1.0);
  for (int i = 0; i < p.n; ++i)
    for (int r = 0; r < 3; ++r) {
      const QuadrupedRow y = factor.project((*points[i])[r]);
      p.c0[i][r] = 0;
      for (int k = 0; k < kQuadrupedDofs; ++k) p.y[i][r][k] = y[k], p.c0[i][r] += y[k] * x[k];
    }
  return p;
}

ContactProblem dense(const RobotProblem& p) {
  ContactProblem d;
  const int m = 3 * p.n;
  d.delassus.resize(m * m);
  d.friction.assign(p.n, p.mu);
  for (int i = 0; i < m; ++i) {
    d.free_velocity.push_back(p.c0[i / 3][i % 3]);
    for (int j = 0; j < m; ++j)
      for (int k = 0; k < kQuadrupedDofs; ++k)
        d.delassus[i * m + j] += p.y[i / 3][i % 3][k] * p.y[j / 3][j % 3][k];
  }
  return d;
}

}  // namespace stickslip::scenes
