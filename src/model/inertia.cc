#include "model/inertia.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "model/pose.h"

namespace stickslip {
namespace {

Matrix3 full(const std::array<double, 6>& I) {
  return {I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5]};
}

// One Jacobi rotation of the symmetric matrix A that zeroes its entry (p, q).
void annihilate(Matrix3& A, int p, int q) {
  const double off = A[3 * p + q];
  if (off == 0) return;
  const double theta = (A[4 * q] - A[4 * p]) / (2 * off);
  const double t = std::copysign(1.0, theta) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
  const double c = 1 / std::sqrt(t * t + 1), s = t * c;
  Matrix3 J{1, 0, 0, 0, 1, 0, 0, 0, 1};
  J[4 * p] = J[4 * q] = c;
  J[3 * p + q] = s;
  J[3 * q + p] = -s;
  A = multiply(multiply(transpose(J), A), J);
  A[3 * p + q] = A[3 * q + p] = 0;
}

}  // namespace

Vector3 principal_moments(const std::array<double, 6>& inertia) {
  Matrix3 A = full(inertia);
  // Cyclic Jacobi converges quadratically: six cycles reach rounding from any start.
  for (int cycle = 0; cycle < 6; ++cycle) {
    annihilate(A, 0, 1);
    annihilate(A, 0, 2);
    annihilate(A, 1, 2);
  }
  Vector3 moments{A[0], A[4], A[8]};
  std::sort(moments.begin(), moments.end());
  return moments;
}

std::string inertia_defect(const std::array<double, 6>& inertia) {
  const auto [a, b, c] = principal_moments(inertia);
  char text[200];
  if (!(a > kSmallestMomentRatio * c)) {
    std::snprintf(text, sizeof text,
                  "is not positive definite (principal moments %.4g, %.4g, %.4g kg m^2)", a, b, c);
    return text;
  }
  if (c > a + b + kTriangleTolerance * c) {
    std::snprintf(text, sizeof text,
                  "breaks the triangle inequality: the largest principal moment exceeds the sum of "
                  "the others by "
                  "%.3g %% (%.4g, %.4g, %.4g kg m^2)",
                  100 * (c - a - b) / c, a, b, c);
    return text;
  }
  return {};
}

Inertial transform(const Pose& X_AB, const Inertial& inertial) {
  const Matrix3& R = X_AB.rotation;
  const Matrix3 I = multiply(multiply(R, full(inertial.inertia)), transpose(R));
  return {inertial.mass,
          transform(X_AB, inertial.center_of_mass),
          {I[0], I[1], I[2], I[4], I[5], I[8]}};
}

Inertial merge(const std::vector<Inertial>& parts) {
  Inertial sum;
  int with_mass = 0;
  for (const Inertial& part : parts) {
    sum.mass += part.mass;
    with_mass += part.mass > 0;
  }
  for (const Inertial& part : parts) {
    if (part.mass == 0) continue;
    // The only part with mass keeps its numbers to the bit.
    const double weight = with_mass == 1 ? 1 : part.mass / sum.mass;
    for (int k = 0; k < 3; ++k) sum.center_of_mass[k] += weight * part.center_of_mass[k];
  }
  // Parallel-axis theorem: I += I_k + m_k (|d|^2 1 - d d^T), d from the common center of mass to
  // the part's.
  for (const Inertial& part : parts) {
    Vector3 d;
    for (int k = 0; k < 3; ++k) d[k] = part.center_of_mass[k] - sum.center_of_mass[k];
    const double m = part.mass, xx = d[0] * d[0], yy = d[1] * d[1], zz = d[2] * d[2];
    const double shift[6] = {m * (yy + zz), -m * d[0] * d[1], -m * d[0] * d[2],
                             m * (xx + zz), -m * d[1] * d[2], m * (xx + yy)};
    for (int k = 0; k < 6; ++k) sum.inertia[k] += part.inertia[k] + shift[k];
  }
  return sum;
}

}  // namespace stickslip
