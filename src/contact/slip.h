// A sliding contact on the plane v_z = 0, as the paper's methods (bisection, golden section,
// quartic) need it: the conic of (C9) in polar angles, plain double. The default method has its own
// lanes (halley.h).
//
//   lambda_T(theta) = r e,  e = (cos theta, sin theta),  r = mu a / d,  d = 1 + mu w.e    [Hwangbo
//   2018] eq. 14 G(theta) = d v_T . J (e + kappa mu w) (C12), [Hwangbo 2018] eq. 15-16
// kappa = 1: maximum dissipation (eq. 8); kappa = 0: Coulomb (eq. 6).
#pragma once
#include "contact/local.h"
#include "lane/math.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// (C5)-(C8) for one sliding contact, and its stick impulse, which lies outside the cone.
struct SlipProblem {
  double a;                          // -c_z / G_zz > 0 [N s]
  double wx, wy;                     // G_zT / G_zz [1]
  double sxx, sxy, syy;              // S [1/kg]
  double bx, by;                     // v_T at lambda_T = 0 [m/s]
  double mu;                         // > 0
  double stick_x, stick_y, stick_z;  // impulse that stops the contact [N s]
};

/// What a single-contact method returns. `converged` false is a failure: the impulse is the best
/// point it saw.
struct SlipSolution {
  double x, y, z;   // [N s]
  int evaluations;  // of the gradient or the energy
  bool converged;
};

/// One point of the conic.
struct ConicPoint {
  double x, y;  // unit direction e
  double d;     // > 0 on the branch that exists
  double r;     // |lambda_T| [N s]; meaningful where d > 0
};

STICKSLIP_INLINE SlipProblem slip_problem(const LocalContact<double>& k, const Reduced<double>& r) {
  return {r.a, k.wx, k.wy, k.sxx, k.sxy, k.syy, r.bx, r.by, k.mu, r.x, r.y, r.z};
}

STICKSLIP_INLINE ConicPoint conic_point(const SlipProblem& p, double angle) {
  ConicPoint q;
  sincos(angle, q.y, q.x);
  q.d = 1 + p.mu * (p.wx * q.x + p.wy * q.y);
  q.r = p.mu * p.a / q.d;
  return q;
}

/// Gradient along the conic over a positive factor, [Hwangbo 2018] eq. 15 (the hybrid form:
/// tangential rows only) [m/s].
STICKSLIP_INLINE double conic_gradient(const SlipProblem& p, const ConicPoint& q, double kappa_mu) {
  const double lx = q.r * q.x, ly = q.r * q.y;
  const double vx = p.sxx * lx + p.sxy * ly + p.bx, vy = p.sxy * lx + p.syy * ly + p.by;
  return vy * (q.x + kappa_mu * p.wx) - vx * (q.y + kappa_mu * p.wy);
}

/// Kinetic energy of the contact point up to a constant, (C10) [J].
STICKSLIP_INLINE double conic_energy(const SlipProblem& p, const ConicPoint& q) {
  const double lx = q.r * q.x, ly = q.r * q.y;
  return 0.5 * (p.sxx * lx * lx + p.syy * ly * ly) + p.sxy * lx * ly + p.bx * lx + p.by * ly;
}

STICKSLIP_INLINE SlipSolution slip_solution(const SlipProblem& p, const ConicPoint& q,
                                            int evaluations, bool converged) {
  return {q.r * q.x, q.r * q.y, q.r / p.mu, evaluations, converged};
}

/// Squared distance of two impulses on the conic [N^2 s^2].
STICKSLIP_INLINE double impulse_distance2(const SlipProblem& p, const ConicPoint& a,
                                          const ConicPoint& b) {
  const double dx = a.r * a.x - b.r * b.x, dy = a.r * a.y - b.r * b.y, dz = (a.r - b.r) / p.mu;
  return dx * dx + dy * dy + dz * dz;
}

/// k of (C13): a point is in line of sight of the stick impulse iff cos(theta - theta0) >= k; below
/// -1 every point is.
STICKSLIP_INLINE double sight_cosine(const SlipProblem& p) {
  return p.mu * p.stick_z / sqrt(p.stick_x * p.stick_x + p.stick_y * p.stick_y);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
