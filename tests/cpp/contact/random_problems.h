// Random contact problems with a fixed seed: four families of single contacts, and a quadruped like
// ANYmal (33 kg, 18 dofs) with feet and torso corners on the ground, dense and factored. Plain
// double code, shared by tests and benchmarks.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

namespace problems {

class Random {  // xorshift64*, so that the samples do not depend on a standard library
 public:
  explicit Random(uint64_t seed) : state_(seed * 2685821657736338717ull + 1) {}
  double uniform(double lo = 0, double hi = 1) {
    state_ ^= state_ >> 12, state_ ^= state_ << 25, state_ ^= state_ >> 27;
    return lo + (hi - lo) * double((state_ * 2685821657736338717ull) >> 11) * 0x1p-53;
  }
  double normal() {
    const double u = 1 - uniform(), v = uniform();
    return std::sqrt(-2 * std::log(u)) * std::cos(6.283185307179586 * v);
  }
  int below(int n) { return int(uniform() * n); }

 private:
  uint64_t state_;
};

struct Matrix3 {
  double m[3][3] = {};
};
inline Matrix3 operator*(const Matrix3& a, const Matrix3& b) {
  Matrix3 r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) r.m[i][j] += a.m[i][k] * b.m[k][j];
  return r;
}
inline Matrix3 turn(int axis, double q) {
  Matrix3 r;
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  r.m[axis][axis] = 1, r.m[i][i] = r.m[j][j] = std::cos(q), r.m[j][i] = std::sin(q),
  r.m[i][j] = -std::sin(q);
  return r;
}
inline Matrix3 random_rotation(Random& rng) {
  return turn(2, rng.uniform(0, 6.3)) * turn(1, std::acos(rng.uniform(-1, 1))) *
         turn(2, rng.uniform(0, 6.3));
}

/// A floating box with four legs of three joints, in a random posture: M (18, 18) and rows of
/// points.
struct Quadruped {
  double mass_matrix[18][18] = {};
  double rows[12][3][18] = {};         // 4 feet, then 8 torso corners
  double sole_rows[4][4][3][18] = {};  // 4 points of a flat sole at each foot
  explicit Quadruped(Random& rng, double tilt = 0.3, double spread = 1) {
    const double half[3] = {0.27, 0.13, 0.12}, leg_mass[3] = {1.4, 1.8, 0.5},
                 length[3] = {0.11, 0.25, 0.32};
    const double inertia[3] = {0.25, 0.75, 0.85};
    const Matrix3 base = turn(0, rng.uniform(-tilt, tilt)) * turn(1, rng.uniform(-tilt, tilt));
    for (int i = 0; i < 3; ++i) mass_matrix[i][i] = 18.5;
    add_inertia(base, inertia, nullptr);
    for (int leg = 0; leg < 4; ++leg) {
      const double sx = leg < 2 ? 1 : -1, sy = leg % 2 ? -1 : 1;
      Matrix3 r = base;
      double p[3] = {}, axis[3][3], origin[3][3];
      move(p, base, sx * 0.28, sy * 0.12, 0);
      const double q[3] = {rng.uniform(-0.5, 0.5),
                           (rng.below(2) ? 1 : -1) * rng.uniform(0.1, 1.2) * spread,
                           (rng.below(2) ? 1 : -1) * rng.uniform(0.3, 2.2)};
      for (int j = 0; j < 3; ++j) {
        const int a = j == 0 ? 0 : 1;
        r = r * turn(a, q[j]);
        for (int i = 0; i < 3; ++i) axis[j][i] = r.m[i][a], origin[j][i] = p[i];
        double com[3] = {p[0], p[1], p[2]};
        const double along = j == 0 ? 0.5 : 0.3;
        move(com, r, 0, j == 0 ? sy * along * length[0] : 0, j == 0 ? 0 : -along * length[j]);
        move(p, r, 0, j == 0 ? sy * length[0] : 0, j == 0 ? 0 : -length[j]);
        double lin[3][18] = {}, ang[3][18] = {};
        jacobian(com, leg, j + 1, axis, origin, lin, ang);
        for (int x = 0; x < 18; ++x)
          for (int y = 0; y < 18; ++y)
            for (int i = 0; i < 3; ++i) mass_matrix[x][y] += leg_mass[j] * lin[i][x] * lin[i][y];
        const double rod = leg_mass[j] * length[j] * length[j] / 12 + 3e-3,
                     link[3] = {rod, rod, 2e-3};
        add_inertia(r, link, ang);
      }
      double unused[3][18] = {};
      jacobian(p, leg, 3, axis, origin, rows[leg], unused);
      for (int s = 0; s < 4; ++s) {
        double corner[3] = {p[0] + (s & 1 ? 0.08 : -0.08), p[1] + (s & 2 ? 0.04 : -0.04), p[2]};
        jacobian(corner, leg, 3, axis, origin, sole_rows[leg][s], unused);
      }
    }
    for (int c = 0; c < 8; ++c) {
      double p[3] = {}, unused[3][18] = {};
      move(p, base, c & 1 ? half[0] : -half[0], c & 2 ? half[1] : -half[1],
           c & 4 ? half[2] : -half[2]);
      jacobian(p, 0, 0, nullptr, nullptr, rows[4 + c], unused);
    }
  }

 private:
  static void move(double p[3], const Matrix3& r, double x, double y, double z) {
    for (int i = 0; i < 3; ++i) p[i] += r.m[i][0] * x + r.m[i][1] * y + r.m[i][2] * z;
  }
  static void jacobian(const double p[3], int leg, int joints, const double axis[][3],
                       const double origin[][3], double lin[3][18], double ang[3][18]) {
    for (int i = 0; i < 3; ++i) lin[i][i] = ang[i][3 + i] = 1;
    lin[0][4] = p[2], lin[0][5] = -p[1], lin[1][3] = -p[2], lin[1][5] = p[0], lin[2][3] = p[1],
    lin[2][4] = -p[0];
    for (int j = 0; j < joints; ++j) {
      const double d[3] = {p[0] - origin[j][0], p[1] - origin[j][1], p[2] - origin[j][2]},
                   *a = axis[j];
      const int c = 6 + 3 * leg + j;
      lin[0][c] = a[1] * d[2] - a[2] * d[1], lin[1][c] = a[2] * d[0] - a[0] * d[2],
      lin[2][c] = a[0] * d[1] - a[1] * d[0];
      for (int i = 0; i < 3; ++i) ang[i][c] = a[i];
    }
  }
  void add_inertia(const Matrix3& r, const double d[3], const double ang[3][18]) {
    for (int k = 0; k < 3; ++k) {
      double row[18] = {};
      for (int i = 0; i < 3; ++i)
        for (int x = 0; x < 18; ++x) row[x] += r.m[i][k] * (ang ? ang[i][x] : x == 3 + i);
      for (int x = 0; x < 18; ++x)
        for (int y = 0; y < 18; ++y) mass_matrix[x][y] += d[k] * row[x] * row[y];
    }
  }
};

/// Y = J L^-1 with M = L^T L: 3 rows of 18.
inline void project_rows(const Quadruped& robot, const double rows[3][18], double y[3][18]) {
  double l[18][18];
  std::memcpy(l, robot.mass_matrix, sizeof l);
  for (int j = 17; j >= 0; --j) {
    l[j][j] = std::sqrt(l[j][j]);
    for (int k = 0; k < j; ++k) l[j][k] /= l[j][j];
    for (int k = 0; k < j; ++k)
      for (int i = 0; i <= k; ++i) l[k][i] -= l[j][k] * l[j][i];
  }
  for (int r = 0; r < 3; ++r) {
    double t[18];
    std::memcpy(t, rows[r], sizeof t);
    for (int j = 17; j >= 0; --j) {
      y[r][j] = t[j] / l[j][j];
      for (int k = 0; k < j; ++k) t[k] -= y[r][j] * l[j][k];
    }
  }
}

/// A single contact: block G (row-major), velocity c, friction mu.
struct Single {
  double g[9], c[3], mu;
};
enum Family { kNearDiagonal, kWishart, kRobotFoot, kIllConditioned, kNumFamilies };
inline const char* name(int family) {
  static const char* const names[] = {"near diagonal", "Wishart", "robot foot", "ill-conditioned"};
  return names[family];
}

inline Single random_single(int family, Random& rng) {
  Single p = {};
  double g[3][3] = {};
  p.mu = rng.uniform(0.1, 1.2);
  const auto add_rotated = [&](const double d[3]) {
    const Matrix3 r = random_rotation(rng);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k) g[i][j] += r.m[i][k] * d[k] * r.m[j][k];
  };
  if (family == kNearDiagonal) {
    const double d[3] = {0.1 * rng.uniform(), 0.1 * rng.uniform(), 0.1 * rng.uniform()};
    add_rotated(d);
    const double t = rng.uniform(0.5, 2);
    g[0][0] += t, g[1][1] += t, g[2][2] += rng.uniform(0.5, 2);
  } else if (family == kWishart) {
    double a[3][6];
    for (auto& row : a)
      for (double& x : row) x = rng.normal();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 6; ++k) g[i][j] += a[i][k] * a[j][k] / 6;
  } else if (family == kRobotFoot) {
    const Quadruped robot(rng, 0.4);
    double y[3][18];
    project_rows(robot, robot.rows[rng.below(4)], y);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 18; ++k) g[i][j] += y[i][k] * y[j][k];
    p.mu = rng.uniform(0.2, 1.2);
  } else {
    double d[3], top = 0;
    for (double& x : d) x = std::pow(10, rng.uniform(-6, 0)), top = std::fmax(top, x);
    for (double& x : d) x /= top;
    add_rotated(d);
    p.mu = std::pow(10, rng.uniform(-1.5, 0.5));
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) p.g[3 * i + j] = 0.5 * (g[i][j] + g[j][i]);
  for (double& x : p.c) x = rng.normal();
  // Random velocities seldom stick: a quarter of the problems gets an impulse inside the cone for
  // its answer.
  if (rng.uniform() < 0.25) {
    const double z = std::fabs(rng.normal()), t = p.mu * z * std::sqrt(rng.uniform()),
                 angle = rng.uniform(0, 6.3);
    const double l[3] = {t * std::cos(angle), t * std::sin(angle), z};
    for (int i = 0; i < 3; ++i)
      p.c[i] = -(p.g[3 * i] * l[0] + p.g[3 * i + 1] * l[1] + p.g[3 * i + 2] * l[2]);
  }
  return p;
}

}  // namespace problems
