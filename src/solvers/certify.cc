#include "solvers/certify.h"

#include <algorithm>
#include <cmath>

#include "lane/math.h"

namespace stickslip::solvers {
namespace {

using contact::LocalContact;

constexpr double kOnCone = 1e-12;  // of mu lambda_z: impulses this near to the mantle lie on it
constexpr double kSlides = 1e-6;   // of the largest |c|: below, a contact has no sliding direction

double length2(const double x[3]) { return std::sqrt(x[0] * x[0] + x[1] * x[1]); }

/// (C60) by (C61): the least |d| for which v + d and the impulse obey Signorini's condition and
/// Coulomb's law: at rest any v + d that opens; inside the cone v + d = 0; on its mantle v + d = -s
/// e, s >= 0. What an impulse has outside its cone counts as a velocity too.
double backward_error(const LocalContact<double>& k, const double v[3], const double l[3]) {
  const double push = std::max(l[2], 0.0), t = length2(l), limit = k.mu * push;
  const double outside = k.scale * (std::max(t - limit, 0.0) + std::max(-l[2], 0.0));
  if (push == 0) return std::max(-v[2], 0.0) + outside;
  if (t < (1 - kOnCone) * limit) return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  // Without friction the impulse has no direction: any sliding agrees with it.
  if (t == 0) return std::fabs(v[2]);
  const double ex = l[0] / t, ey = l[1] / t;
  const double s = std::max(0.0, -(v[0] * ex + v[1] * ey));
  const double x = v[0] + s * ex, y = v[1] + s * ey;
  return std::sqrt(x * x + y * y + v[2] * v[2]) + outside;
}

/// The larger; what is not a number counts as infinite.
double worse(double a, double b) { return b <= a ? a : b == b ? b : INFINITY; }

/// Angle between lambda_T and -v_T [rad], of (C64); atan2 keeps small angles exact.
double direction_angle(const double v[3], const double l[3]) {
  const double cross = l[0] * v[1] - l[1] * v[0], dot = -(l[0] * v[0] + l[1] * v[1]);
  return atan2(std::fabs(cross), dot);
}

}  // namespace

/// The largest of (C3) or (C25), (C61) and (C64) over the contacts.
Certificate certify(const contact::ExplicitProblem& p, bool max_dissipation) {
  Certificate out;
  out.residuals.resize(p.n);
  out.backward_errors.resize(p.n);
  double fastest = 0;
  for (int r = 0; r < 3 * p.n; ++r) fastest = std::max(fastest, std::fabs(p.c[r]));
  for (int i = 0; i < p.n; ++i) {
    const LocalContact<double>& k = p.local[i];
    const double *v = p.v + 3 * i, *l = p.lambda + 3 * i;
    const double e = contact_residual(p, i, max_dissipation), speed = length2(v);
    out.residuals[i] = worse(0, e);
    out.backward_errors[i] = worse(0, backward_error(k, v, l));
    out.residual = worse(out.residual, e);
    out.backward_error = worse(out.backward_error, out.backward_errors[i]);
    out.penetration_speed = worse(out.penetration_speed, -v[2]);
    out.cone_violation = worse(out.cone_violation, length2(l) - k.mu * l[2]);
    if (speed > kSlides * fastest && k.scale * length2(l) > kSlides * fastest)
      out.direction_error = worse(out.direction_error, direction_angle(v, l));
    out.power =
        worse(out.power, std::fabs(l[0] * v[0] + l[1] * v[1] + l[2] * (v[2] + k.mu * speed)));
  }
  return out;
}

}  // namespace stickslip::solvers
