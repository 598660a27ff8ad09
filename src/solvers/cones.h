// Projections on the friction cones |lambda_T| <= mu lambda_z.
#pragma once
#include "contact/explicit_problem.h"

namespace stickslip::solvers {

/// The nearest point of the cone.
inline void project_on_cone(double mu, double* x) {
  const double t = sqrt(x[0] * x[0] + x[1] * x[1]);
  if (t <= mu * x[2]) return;
  const double z = (mu * t + x[2]) / (1 + mu * mu), f = z > 0 ? mu * z / t : 0;
  x[0] *= f, x[1] *= f, x[2] = max(z, 0.0);
}

/// Brings every impulse into its cone: the normal part kept if it is not negative, the tangential
/// part shortened. A contact that cannot push gets none.
inline void project_on_cones(contact::ExplicitProblem& p) {
  for (int i = 0; i < p.n; ++i) {
    double* l = p.lambda + 3 * i;
    if (!(p.local[i].inv_zz > 0)) l[0] = l[1] = l[2] = 0;
    l[2] = max(l[2], 0.0);
    const double square = l[0] * l[0] + l[1] * l[1], limit = p.local[i].mu * l[2];
    if (square > limit * limit) {
      const double f = limit / sqrt(square);
      l[0] *= f, l[1] *= f;
    }
  }
}

/// lambda <- P_K(scale lambda - u) / scale with the velocities p.v: the point that the residual
/// (C3) compares with. What is nearly open becomes open, what nearly slides gets an impulse on the
/// mantle of its cone.
inline void settle_on_cones(contact::ExplicitProblem& p) {
  for (int i = 0; i < p.n; ++i) {
    const contact::LocalContact<double>& k = p.local[i];
    if (!(k.inv_zz > 0)) continue;
    const double* v = p.v + 3 * i;
    double *l = p.lambda + 3 * i, x[3];
    for (int r = 0; r < 3; ++r) x[r] = k.scale * l[r] - v[r];
    x[2] -= k.mu * sqrt(v[0] * v[0] + v[1] * v[1]);
    project_on_cone(k.mu, x);
    for (int r = 0; r < 3; ++r) l[r] = x[r] / k.scale;
  }
}

}  // namespace stickslip::solvers
