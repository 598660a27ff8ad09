// Random single-contact problems: four families, each a mix of opening, sticking and sliding
// contacts. Used by tests and benchmarks. Double, libm allowed: none of it is a kernel.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace stickslip::scenes {

struct SingleContact {
  std::array<double, 9> G;  // row-major [1/kg]
  std::array<double, 3> c;  // [m/s]
  double mu;
};

enum class ContactFamily {
  kNearDiagonal,   ///< like a foot straight below the body
  kWishart,        ///< G = A A^T / 6 with A 3x6 normal
  kRobotFoot,      ///< foot of a three-joint leg on a floating box, random posture
  kIllConditioned  ///< condition numbers up to 1e6, friction up to 3: a sixth of the conics is
                   ///< unbounded
};
inline const char* family_name(ContactFamily f) {
  constexpr const char* kNames[] = {"near diagonal", "Wishart", "robot foot", "ill-conditioned"};
  return kNames[static_cast<int>(f)];
}

/// splitmix64 with the two distributions the families need; the same numbers on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  double uniform(double lo, double hi) {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return lo + (hi - lo) * static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }
  double normal() {
    const double u = uniform(0, 1), v = uniform(0, 1);
    return std::sqrt(-2 * std::log(1 - u)) * std::cos(6.283185307179586 * v);
  }

 private:
  std::uint64_t state_;
};

namespace families {

using Mat3 = std::array<double, 9>;
using Vec3 = std::array<double, 3>;

inline Mat3 multiply(const Mat3& a, const Mat3& b) {
  Mat3 r{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) r[3 * i + j] += a[3 * i + k] * b[3 * k + j];
  return r;
}
inline Vec3 multiply(const Mat3& a, const Vec3& b) {
  Vec3 r{};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) r[i] += a[3 * i + k] * b[k];
  return r;
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Mat3 rotation(int axis, double angle) {
  Mat3 r{};
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  r[4 * axis] = 1, r[4 * i] = r[4 * j] = std::cos(angle);
  r[3 * i + j] = -std::sin(angle), r[3 * j + i] = std::sin(angle);
  return r;
}
inline Mat3 random_rotation(Random& rng) {
  double q[4], n = 0;
  for (double& x : q) x = rng.normal(), n += x * x;
  for (double& x : q) x /= std::sqrt(n);
  const auto [w, x, y, z] = q;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}
/// Q diag(d) Q^T
inline Mat3 conjugate(const Mat3& q, const Vec3& d) {
  Mat3 r{};
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) r[3 * i + j] += q[3 * i + k] * d[k] * q[3 * j + k];
      r[3 * j + i] = r[3 * i + j];
    }
  return r;
}

/// G = J M^-1 J^T of the foot of a leg with three joints (roll, pitch, pitch) on a floating box of
/// 20 kg.
inline Mat3 robot_foot(Random& rng) {
  constexpr double kMass[3] = {1.5, 2.5, 0.6}, kLength[3] = {0.08, 0.28, 0.30};
  const double q[3] = {rng.uniform(-0.6, 0.6), rng.uniform(-1.3, 1.3), rng.uniform(-2.4, 2.4)};
  const Mat3 base =
      multiply(rotation(0, rng.uniform(-0.4, 0.4)), rotation(1, rng.uniform(-0.4, 0.4)));
  const Vec3 hip = multiply(
      base, Vec3{rng.uniform(-1, 1) < 0 ? -0.3 : 0.3, rng.uniform(-1, 1) < 0 ? -0.12 : 0.12, 0});
  Mat3 link[3];
  Vec3 joint[4] = {hip}, axis[3];
  for (int i = 0; i < 3; ++i) {
    link[i] = multiply(i ? link[i - 1] : base, rotation(i ? 1 : 0, q[i]));
    const int column = i ? 1 : 0;
    axis[i] = {link[i][column], link[i][3 + column], link[i][6 + column]};
    const Vec3 along = multiply(link[i], i ? Vec3{0, 0, -kLength[i]} : Vec3{0, kLength[0], 0});
    for (int k = 0; k < 3; ++k) joint[i + 1][k] = joint[i][k] + along[k];
  }
  // Rows of the Jacobian of a point on link `last` (6 base dofs, 3 joints): linear, angular.
  const auto jacobian = [&](const Vec3& point, int last, double linear[3][9],
                            double angular[3][9]) {
    for (int r = 0; r < 3; ++r)
      for (int j = 0; j < 9; ++j) linear[r][j] = angular[r][j] = 0;
    for (int j = 0; j < 3; ++j) {
      const Vec3 unit{j == 0 ? 1.0 : 0.0, j == 1 ? 1.0 : 0.0, j == 2 ? 1.0 : 0.0},
          turn = cross(unit, point);
      for (int r = 0; r < 3; ++r)
        linear[r][j] = angular[r][3 + j] = unit[r], linear[r][3 + j] = turn[r];
    }
    for (int j = 0; j <= last; ++j) {
      const Vec3 arm{point[0] - joint[j][0], point[1] - joint[j][1], point[2] - joint[j][2]},
          turn = cross(axis[j], arm);
      for (int r = 0; r < 3; ++r) linear[r][6 + j] = turn[r], angular[r][6 + j] = axis[j][r];
    }
  };
  double M[9][9] = {}, linear[3][9], angular[3][9];
  const auto add_body = [&](double mass, const Mat3& inertia) {
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j < 9; ++j)
        for (int r = 0; r < 3; ++r) {
          M[i][j] += mass * linear[r][i] * linear[r][j];
          for (int s = 0; s < 3; ++s) M[i][j] += angular[r][i] * inertia[3 * r + s] * angular[s][j];
        }
  };
  jacobian({0, 0, 0}, -1, linear, angular);
  add_body(20, conjugate(base, {0.3, 0.9, 1.0}));
  for (int i = 0; i < 3; ++i) {
    const Vec3 center{(joint[i][0] + joint[i + 1][0]) / 2, (joint[i][1] + joint[i + 1][1]) / 2,
                      (joint[i][2] + joint[i + 1][2]) / 2};
    const double inertia = kMass[i] * kLength[i] * kLength[i] / 12 + 2e-3;
    jacobian(center, i, linear, angular);
    add_body(kMass[i], conjugate(link[i], {inertia, inertia, 1e-3}));
  }
  // M = L L^T, Y = L^-1 J^T, G = Y^T Y
  for (int j = 0; j < 9; ++j)
    for (int i = j; i < 9; ++i) {
      for (int k = 0; k < j; ++k) M[i][j] -= M[i][k] * M[j][k];
      M[i][j] = i == j ? std::sqrt(M[i][j]) : M[i][j] / M[j][j];
    }
  jacobian(joint[3], 2, linear, angular);
  Mat3 G{};
  for (int r = 0; r < 3; ++r)
    for (int i = 0; i < 9; ++i) {
      for (int k = 0; k < i; ++k) linear[r][i] -= M[i][k] * linear[r][k];
      linear[r][i] /= M[i][i];
    }
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s)
      for (int i = 0; i < 9; ++i) G[3 * r + s] += linear[r][i] * linear[s][i];
  return G;
}

inline Mat3 random_block(ContactFamily family, Random& rng, double& mu) {
  mu = rng.uniform(0.1, 1.2);
  switch (family) {
    case ContactFamily::kNearDiagonal: {
      Mat3 G = conjugate(random_rotation(rng),
                         {rng.uniform(0, 0.1), rng.uniform(0, 0.1), rng.uniform(0, 0.1)});
      const double tangential = rng.uniform(0.5, 2);
      G[0] += tangential, G[4] += tangential, G[8] += rng.uniform(0.5, 2);
      return G;
    }
    case ContactFamily::kWishart: {
      double a[3][6];
      for (auto& row : a)
        for (double& x : row) x = rng.normal();
      Mat3 G{};
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          for (int k = 0; k < 6; ++k) G[3 * i + j] += a[i][k] * a[j][k] / 6;
      return G;
    }
    case ContactFamily::kRobotFoot:
      mu = rng.uniform(0.2, 1.2);
      return robot_foot(rng);
    default: {
      mu = std::pow(10, rng.uniform(-1.5, 0.5));
      const Mat3 q = random_rotation(rng);
      Vec3 d;
      for (double& x : d) x = std::pow(10, rng.uniform(-6, 0));
      const double largest = std::fmax(d[0], std::fmax(d[1], d[2]));
      for (double& x : d) x /= largest;
      return conjugate(q, d);
    }
  }
}

/// The sliding impulse of least energy, by halving the gradient's sign on the visible arc; false if
/// the contact sticks. Its norm scales the problems, so that tolerances in N s mean the same in
/// every family.
inline bool slip_impulse(const Mat3& G, const Vec3& c, double mu, Vec3& lambda) {
  const double a = -c[2] / G[8], wx = G[2] / G[8], wy = G[5] / G[8];
  const double sxx = G[0] - G[2] * wx, sxy = G[1] - G[2] * wy, syy = G[4] - G[5] * wy;
  const double bx = c[0] + G[2] * a, by = c[1] + G[5] * a, det = sxx * syy - sxy * sxy;
  const double x = -(syy * bx - sxy * by) / det, y = -(sxx * by - sxy * bx) / det,
               z = a - wx * x - wy * y;
  if (z >= 0 && std::hypot(x, y) <= mu * z * (1 + 1e-9)) return false;
  const double start = std::atan2(y, x), k = mu * z / std::hypot(x, y),
               half = k < -1 ? M_PI : std::acos(std::fmin(k, 1));
  double lo = -half, hi = half;
  for (int i = 0; i < 80; ++i) {
    const double middle = (lo + hi) / 2, ex = std::cos(start + middle),
                 ey = std::sin(start + middle);
    const double d = 1 + mu * (wx * ex + wy * ey), r = mu * a / d;
    lambda = {r * ex, r * ey, r / mu};
    const double vx = sxx * r * ex + sxy * r * ey + bx, vy = sxy * r * ex + syy * r * ey + by;
    const bool right = d <= 0 ? middle > 0 : vy * (ex + mu * wx) - vx * (ey + mu * wy) > 0;
    (right ? hi : lo) = middle;
  }
  return lambda[2] > 0;
}

}  // namespace families

enum class ContactMix { kAll, kSlipOnly };

/// `count` problems of a family: a third opens, a third sticks, a third slides (kSlipOnly: all
/// slide). The impulse of a closing contact has norm 1 N s.
inline std::vector<SingleContact> random_contacts(ContactFamily family, int count,
                                                  std::uint64_t seed,
                                                  ContactMix mix = ContactMix::kAll) {
  Random rng(seed);
  std::vector<SingleContact> out;
  out.reserve(count);
  while (static_cast<int>(out.size()) < count) {
    SingleContact p;
    p.G = families::random_block(family, rng, p.mu);
    for (double& x : p.c) x = rng.normal();
    const int kind = mix == ContactMix::kSlipOnly ? 2 : static_cast<int>(out.size() % 3);
    if (kind == 0) {
      p.c[2] = std::fabs(p.c[2]);
    } else if (kind == 1) {
      // c = -G lambda for a lambda inside the cone
      const double angle = rng.uniform(-M_PI, M_PI), t = p.mu * std::sqrt(rng.uniform(0, 0.999));
      const double n = 1 / std::sqrt(1 + t * t);
      p.c = families::multiply(
          p.G, families::Vec3{-n * t * std::cos(angle), -n * t * std::sin(angle), -n});
      if (!(p.c[2] < 0)) continue;
    } else {
      p.c[2] = -std::fabs(p.c[2]);
      std::array<double, 3> lambda;
      if (!families::slip_impulse(p.G, p.c, p.mu, lambda)) continue;
      const double norm =
          std::sqrt(lambda[0] * lambda[0] + lambda[1] * lambda[1] + lambda[2] * lambda[2]);
      for (double& x : p.c) x /= norm;
    }
    out.push_back(p);
  }
  return out;
}

}  // namespace stickslip::scenes
