#include "scenes/contact_families.h"

#include <cmath>

#include "scenes/quadruped.h"
#include "scenes/vector.h"

namespace stickslip::scenes {
namespace {

Matrix3 random_rotation(Random& rng) {
  double q[4], n = 0;
  for (double& x : q) x = rng.normal(), n += x * x;
  for (double& x : q) x /= std::sqrt(n);
  const auto [w, x, y, z] = q;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}
/// Q diag(d) Q^T
Matrix3 conjugate(const Matrix3& q, const Vector3& d) {
  Matrix3 r{};
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) r[3 * i + j] += q[3 * i + k] * d[k] * q[3 * j + k];
      r[3 * j + i] = r[3 * i + j];
    }
  return r;
}

/// G = J M^-1 J^T of a foot.
Matrix3 robot_foot(Random& rng) {
  const Quadruped robot(rng, 0.4);
  const QuadrupedFactor factor(robot);
  const PointRows& foot = robot.feet[rng.below(4)];
  QuadrupedRow y[3];
  for (int r = 0; r < 3; ++r) y[r] = factor.project(foot[r]);
  Matrix3 G{};
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s)
      for (int k = 0; k < kQuadrupedDofs; ++k) G[3 * r + s] += y[r][k] * y[s][k];
  return G;
}

Matrix3 random_block(ContactFamily family, Random& rng, double& mu) {
  mu = rng.uniform(0.1, 1.2);
  switch (family) {
    case ContactFamily::kNearDiagonal: {
      Matrix3 G = conjugate(random_rotation(rng),
                            {rng.uniform(0, 0.1), rng.uniform(0, 0.1), rng.uniform(0, 0.1)});
      const double tangential = rng.uniform(0.5, 2);
      G[0] += tangential, G[4] += tangential, G[8] += rng.uniform(0.5, 2);
      return G;
    }
    case ContactFamily::kWishart: {
      double a[3][6];
      for (auto& row : a)
        for (double& x : row) x = rng.normal();
      Matrix3 G{};
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          for (int k = 0; k < 6; ++k) G[3 * i + j] += a[i][k] * a[j][k] / 6;
      return G;
    }
    case ContactFamily::kRobotFoot:
      mu = rng.uniform(0.2, 1.2);
      return robot_foot(rng);
    default: {
      mu = rng.log_uniform(0.0316, 3.16);
      const Matrix3 q = random_rotation(rng);
      Vector3 d;
      for (double& x : d) x = rng.log_uniform(1e-6, 1);
      const double largest = std::fmax(d[0], std::fmax(d[1], d[2]));
      for (double& x : d) x /= largest;
      return conjugate(q, d);
    }
  }
}

/// The sliding impulse of least energy, by halving the gradient's sign on the visible arc; false if
/// the contact sticks. Its norm scales the problems, so that tolerances in N s mean the same in
/// every family.
bool slip_impulse(const Matrix3& G, const Vector3& c, double mu, Vector3& lambda) {
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
    const double middle = (lo + hi) / 2;
    double ex, ey;
    sincos(start + middle, ey, ex);
    const double d = 1 + mu * (wx * ex + wy * ey), r = mu * a / d;
    lambda = {r * ex, r * ey, r / mu};
    const double vx = sxx * r * ex + sxy * r * ey + bx, vy = sxy * r * ex + syy * r * ey + by;
    const bool right = d <= 0 ? middle > 0 : vy * (ex + mu * wx) - vx * (ey + mu * wy) > 0;
    (right ? hi : lo) = middle;
  }
  return lambda[2] > 0;
}

}  // namespace

const char* family_name(ContactFamily family) {
  constexpr const char* kNames[] = {"near diagonal", "Wishart", "robot foot", "ill-conditioned"};
  return kNames[static_cast<int>(family)];
}

std::vector<SingleContact> random_contacts(ContactFamily family, int count, std::uint64_t seed,
                                           ContactMix mix) {
  Random rng(seed);
  std::vector<SingleContact> out;
  out.reserve(count);
  while (static_cast<int>(out.size()) < count) {
    SingleContact p;
    p.G = random_block(family, rng, p.mu);
    for (double& x : p.c) x = rng.normal();
    const int kind = mix == ContactMix::kSlipOnly ? 2 : static_cast<int>(out.size() % 3);
    if (kind == 0) {
      p.c[2] = std::fabs(p.c[2]);
    } else if (kind == 1) {
      // c = -G lambda for a lambda inside the cone
      const double angle = rng.uniform(-M_PI, M_PI), t = p.mu * std::sqrt(rng.uniform(0, 0.999));
      const double n = 1 / std::sqrt(1 + t * t);
      double sine, cosine;
      sincos(angle, sine, cosine);
      p.c = p.G * Vector3{-n * t * cosine, -n * t * sine, -n};
      if (!(p.c[2] < 0)) continue;
    } else {
      p.c[2] = -std::fabs(p.c[2]);
      Vector3 lambda;
      if (!slip_impulse(p.G, p.c, p.mu, lambda)) continue;
      const double norm = std::sqrt(dot(lambda, lambda));
      for (double& x : p.c) x /= norm;
    }
    out.push_back(p);
  }
  return out;
}

}  // namespace stickslip::scenes
