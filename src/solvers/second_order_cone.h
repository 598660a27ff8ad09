// The cone {x_z >= |x_T|} and its Jordan algebra, z the scalar part: what an interior-point step
// needs of one contact (docs/theory/solvers.md (C42), (C43)).
#pragma once
#include "lane/lane.h"

namespace stickslip::solvers {

/// Of x_z squared: the least distance to the boundary, where rounding leaves none.
inline constexpr double kLeastDistance = 1e-17;

/// |x_T|
inline double tangential(const double x[3]) { return sqrt(x[0] * x[0] + x[1] * x[1]); }
/// x_z^2 - |x_T|^2, not negative: iterates may lie as near to the boundary as rounding lets them.
inline double determinant(const double x[3]) {
  const double t = tangential(x);
  return max((x[2] - t) * (x[2] + t), kLeastDistance * x[2] * x[2]);
}
/// x o y
inline void product(const double x[3], const double y[3], double out[3]) {
  out[0] = x[2] * y[0] + y[2] * x[0];
  out[1] = x[2] * y[1] + y[2] * x[1];
  out[2] = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}
/// k with l o k = r.
inline void divide(const double l[3], const double r[3], double k[3]) {
  const double det = determinant(l);
  k[2] = (l[2] * r[2] - l[0] * r[0] - l[1] * r[1]) / det;
  for (int i = 0; i < 2; ++i) k[i] = (r[i] - k[2] * l[i]) / l[2];
}
/// The largest t up to which x + t d stays in the cone.
inline double to_boundary(const double x[3], const double d[3]) {
  const double a = (d[2] - tangential(d)) * (d[2] + tangential(d));
  const double b = x[2] * d[2] - x[0] * d[0] - x[1] * d[1], c = determinant(x);
  double t = __builtin_inf();
  if (const double disc = b * b - a * c; disc >= 0) {
    const double q = -(b + (b < 0 ? -sqrt(disc) : sqrt(disc)));
    if (a != 0 && q / a > 0) t = q / a;
    if (q != 0 && c / q > 0) t = min(t, c / q);
  }
  if (d[2] < 0) t = min(t, -x[2] / d[2]);
  return t;
}

/// Scaling point of Nesterov and Todd (C43): S = eta V(w) with S y = S^-1 x.
struct Scaling {
  double w[3], eta;
};
inline Scaling scaling(const double x[3], const double y[3]) {
  const double dx = sqrt(determinant(x)), dy = sqrt(determinant(y));
  double a[3], b[3];
  for (int i = 0; i < 3; ++i) a[i] = x[i] / dx, b[i] = y[i] / dy;
  const double g = sqrt(0.5 * (1 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]));
  return {{(a[0] - b[0]) / (2 * g), (a[1] - b[1]) / (2 * g), (a[2] + b[2]) / (2 * g)},
          sqrt(dx / dy)};
}
/// out = S x, or S^-1 x with sign = -1.
inline void scale(const Scaling& s, double sign, const double x[3], double out[3]) {
  const double w0 = sign * s.w[0], w1 = sign * s.w[1], along = w0 * x[0] + w1 * x[1];
  const double eta = sign > 0 ? s.eta : 1 / s.eta, f = x[2] + along / (1 + s.w[2]);
  out[0] = eta * (x[0] + f * w0);
  out[1] = eta * (x[1] + f * w1);
  out[2] = eta * (s.w[2] * x[2] + along);
}
/// S^-2, (3, 3) row-major: (2 v v^T - J) / eta^2 with v = J w.
inline void inverse_square(const Scaling& s, double out[9]) {
  const double v[3] = {-s.w[0], -s.w[1], s.w[2]}, f = 1 / (s.eta * s.eta);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      out[3 * r + c] = f * (2 * v[r] * v[c] + (r != c ? 0 : r == 2 ? -1 : 1));
}

}  // namespace stickslip::solvers
