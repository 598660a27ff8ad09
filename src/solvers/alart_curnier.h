// Map of Alart and Curnier for one contact, in velocity units, and an element of its generalized
// derivative (docs/theory/solvers.md (C30), (C31)): zero exactly at a solution under Coulomb's law.
//
//   s = scale lambda_z - u_z,  t = scale lambda_T - u_T,  e = t / |t|,  limit = mu max(0, s)
//   F_z = u_z if s > 0, else scale lambda_z
//   F_T = u_T if |t| <= limit (stick), else scale lambda_T - limit e
#pragma once
#include "contact/local.h"

namespace stickslip::solvers {

/// F; dF = A dlambda + B du, (3, 3) row-major.
struct AlartCurnier {
  double F[3], A[9], B[9];
  bool active;  // s > 0; else A = scale I, B = 0
};

inline double squared(const double x[3]) { return x[0] * x[0] + x[1] * x[1] + x[2] * x[2]; }

/// s; negative for a contact that cannot push, which takes no part.
inline double push_of(const contact::LocalContact<double>& k, const double lambda[3],
                      const double u[3]) {
  return k.inv_zz > 0 ? k.scale * lambda[2] - u[2] : -1;
}

/// F alone.
inline void alart_curnier_value(const contact::LocalContact<double>& k, const double lambda[3],
                                const double u[3], double F[3]) {
  const double s = push_of(k, lambda, u), limit = k.mu * max(s, 0.0);
  const double t0 = k.scale * lambda[0] - u[0], t1 = k.scale * lambda[1] - u[1];
  const double norm = sqrt(t0 * t0 + t1 * t1), f = norm > limit ? limit / norm : 1;
  F[0] = norm > limit ? k.scale * lambda[0] - f * t0 : u[0];
  F[1] = norm > limit ? k.scale * lambda[1] - f * t1 : u[1];
  F[2] = s > 0 ? u[2] : k.scale * lambda[2];
}

inline void alart_curnier(const contact::LocalContact<double>& k, const double lambda[3],
                          const double u[3], AlartCurnier& c) {
  const double s = push_of(k, lambda, u), limit = k.mu * max(s, 0.0);
  const double t0 = k.scale * lambda[0] - u[0], t1 = k.scale * lambda[1] - u[1];
  const double norm = sqrt(t0 * t0 + t1 * t1);
  alart_curnier_value(k, lambda, u, c.F);
  for (int i = 0; i < 9; ++i) c.A[i] = c.B[i] = 0;
  c.active = s > 0;
  if (!c.active) {
    c.A[0] = c.A[4] = c.A[8] = k.scale;
    return;
  }
  c.B[8] = 1;
  if (norm <= limit) {
    c.B[0] = c.B[4] = 1;
    return;
  }
  // d(limit e) = mu e ds + limit / |t| (1 - e e^T) dt
  const double e0 = t0 / norm, e1 = t1 / norm, ratio = limit / norm;
  const double q00 = ratio * (1 - e0 * e0), q01 = -ratio * e0 * e1, q11 = ratio * (1 - e1 * e1);
  c.B[0] = q00, c.B[1] = c.B[3] = q01, c.B[4] = q11;
  c.B[2] = k.mu * e0, c.B[5] = k.mu * e1;
  c.A[0] = k.scale * (1 - q00), c.A[1] = c.A[3] = -k.scale * q01, c.A[4] = k.scale * (1 - q11);
  c.A[2] = -k.scale * c.B[2], c.A[5] = -k.scale * c.B[5];
}

}  // namespace stickslip::solvers
