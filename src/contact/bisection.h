// Bisection on the angle of a sliding impulse: [Hwangbo 2018] Algorithm 1 with its printed faults
// corrected.
//
// Where we differ from the printed algorithm, and why (docs/theory/contact.md, section 4):
//  - line 13: "out of sight" is grad h2 . (lambda - lambda_0) > 0; with the printed "<" the
//  stepping never ends;
//  - lines 13-14: a rejected step restores lambda together with theta, or line 33 compares with a
//  rejected point;
//  - line 6: a start that is optimal already (isotropic G) returns at once, or alpha = 0 steps
//  forever;
//  - lines 29, 31: lambda and lambda^p follow their angles, or line 33 never changes;
//  - both loops are capped, a step never turns by more than pi in all, and the midpoint of the last
//  interval is returned.
// Coulomb's law (kappa = 0) has the same sign change between theta_0 and the direction of S e_0,
// less than 90 degrees away (C19), so the stepping stops there.
#pragma once
#include "contact/slip.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// beta_1..3 of Algorithm 1. The paper does not print its values; these are the ones in use since.
struct BisectionSteps {
  double first = 0.01;  // beta_1 [rad]
  double shrink = 0.5;  // beta_2
  double grow = 1.3;    // beta_3
};

/// Signed angle from theta_0 to the end of the Coulomb bracket, in (-pi/2, pi/2), (C19).
STICKSLIP_INLINE double coulomb_bracket(const SlipProblem& p) {
  // theta_0 points along e_0, the end along S e_0.
  const double x = p.stick_x, y = p.stick_y;
  const double ux = p.sxx * x + p.sxy * y, uy = p.sxy * x + p.syy * y;
  return atan2(x * uy - y * ux, x * ux + y * uy);
}

inline SlipSolution solve_bisection(const SlipProblem& p, bool coulomb, double tolerance,
                                    const BisectionSteps& beta = {}) {
  constexpr double kPi = 3.14159265358979323846;
  constexpr int kMaxSteps = 2000, kMaxHalvings = 200;
  const double kappa_mu = coulomb ? 0 : p.mu;
  const double theta0 = atan2(p.stick_y, p.stick_x);
  ConicPoint point = conic_point(p, theta0);
  const double gradient0 = conic_gradient(p, point, kappa_mu);
  int evaluations = 1;
  if (gradient0 == 0) return slip_solution(p, point, evaluations, true);

  // How far the stepping may turn, and which way: against the gradient.
  const double sign = gradient0 > 0 ? -1 : 1;
  const double reach = coulomb ? sign * coulomb_bracket(p) : kPi;
  if (!(reach > 0))
    return slip_solution(p, point, evaluations, true);  // gradient0 is rounding error

  // Lines 7-23: step until the gradient changes sign.
  double turn = 0, previous_turn = 0, step = beta.first;
  ConicPoint previous = point;
  bool found = false;
  for (int i = 0; i < kMaxSteps && !found; ++i) {
    previous_turn = turn, previous = point;
    turn = min(turn + step, reach);
    point = conic_point(p, theta0 + sign * turn);
    bool out = point.d <= 0;
    if (!coulomb && !out) {
      // (lambda_T . stick_T - mu^2 lambda_z stick_z) < 0, divided by r > 0
      out = point.x * p.stick_x + point.y * p.stick_y < p.mu * p.stick_z;
    }
    if (out) {
      step *= beta.shrink, turn = previous_turn, point = previous;
      if (step < 1e-16) break;  // the root is at the edge of sight
      continue;
    }
    ++evaluations;
    // The end of the reach closes the interval by theory, whatever rounding says about its sign.
    found = conic_gradient(p, point, kappa_mu) * gradient0 <= 0 || turn >= reach;
    if (!found) step *= beta.grow;
  }
  if (!found) return slip_solution(p, point, evaluations, step < 1e-16);

  // Lines 24-33: halve. The interval of angles is one rounding wide at the latest after 60
  // halvings.
  double low = previous_turn, high = turn;
  ConicPoint low_point = previous, high_point = point;
  bool converged = false;
  for (int i = 0; i < kMaxHalvings; ++i) {
    converged = impulse_distance2(p, low_point, high_point) < tolerance * tolerance;
    const double middle = 0.5 * (low + high);
    if (converged || middle <= low || middle >= high) break;
    const ConicPoint q = conic_point(p, theta0 + sign * middle);
    ++evaluations;
    if (conic_gradient(p, q, kappa_mu) * gradient0 > 0)
      low = middle, low_point = q;
    else
      high = middle, high_point = q;
  }
  // An interval that cannot be halved any more is as good as double gets: that is not a failure.
  converged = converged || high - low < 1e-14;
  return slip_solution(p, conic_point(p, theta0 + sign * 0.5 * (low + high)), evaluations,
                       converged);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
