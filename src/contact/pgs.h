// Projected Gauss-Seidel, component by component, [Hwangbo 2018] eq. 17 and 18. Coulomb's law only.
//
//   lambda_z <- max(0, lambda_z - r_z v_z),                     r_z = alpha / G_zz
//   lambda_T <- P_disc(mu lambda_z)(lambda_T - r_T v_T),        r_T = alpha / max(G_xx, G_yy)
// The velocities are those of the newest impulses: the tangential step sees the normal one.
#pragma once
#include "contact/explicit_problem.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

inline void pgs_sweep(ExplicitProblem& p, double alpha, double& updates) {
  for (int i = 0; i < p.n; ++i) {
    const LocalContact<double>& k = p.local[i];
    double *l = p.lambda + 3 * i, *v = p.v + 3 * i;
    const double z = max(l[2] - alpha * k.inv_zz * v[2], 0.0), dz = z - l[2];
    if (dz != 0) add_component(p, 3 * i + 2, dz);
    const double largest = max(k.xx, k.yy), r = largest > 0 ? alpha / largest : 0;
    double x = l[0] - r * v[0], y = l[1] - r * v[1];
    const double size2 = x * x + y * y, limit = k.mu * l[2];
    if (size2 > limit * limit) {
      const double shrink = limit / sqrt(size2);
      x *= shrink, y *= shrink;
    }
    const double dx = x - l[0], dy = y - l[1];
    if (dx != 0) add_component(p, 3 * i, dx);
    if (dy != 0) add_component(p, 3 * i + 1, dy);
    updates += sqrt(dx * dx + dy * dy + dz * dz);
  }
}

/// Sweeps until the stop test is met; `p` must be prepared, alpha stays as it is.
inline SweepResult pgs(ExplicitProblem& p, const SweepOptions& o) {
  SweepResult r;
  while (r.sweeps < o.max_sweeps) {
    double updates = 0;
    pgs_sweep(p, o.alpha, updates);
    if (end_sweep(p, o, updates, r)) break;
  }
  return r;
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
