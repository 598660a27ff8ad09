// The analytic method: the quartic of (C15) in closed form (Ferrari), and the checks that pick its
// root.
//
//   p(tau) = (1 + tau^2)^2 G,  tau = tan((theta - theta_0) / 2),  basis e_0 = stick_T / |stick_T|,
//   J e_0
// Closed form loses digits where roots meet or q_4 vanishes (nearly isotropic G): that is the
// method's weakness, so its failures are reported. `polish` Newton steps repair most of them. Stop
// criterion: the next Newton step in impulse.
#pragma once
#include "contact/halley.h"
#include "contact/slip.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Real roots of z^3 + c2 z^2 + c1 z + c0: the largest one.
inline double largest_cubic_root(double c2, double c1, double c0) {
  constexpr double kThirdTurn = 2.09439510239319549231;
  const double q = (c2 * c2 - 3 * c1) / 9, r = (2 * c2 * c2 * c2 - 9 * c2 * c1 + 27 * c0) / 54;
  const double q3 = q * q * q;
  if (r * r < q3) {
    // Three real roots -2 sqrt(q) cos((phi + 2 pi k) / 3) - c2 / 3, phi in [0, pi]; the largest is
    // k = -1 or 1.
    const double phi = acos(r / sqrt(q3)) / 3, root = sqrt(q);
    double sine, c_minus, c_plus;
    sincos(phi - kThirdTurn, sine, c_minus);
    sincos(phi + kThirdTurn, sine, c_plus);
    return -2 * root * min(c_minus, c_plus) - c2 / 3;
  }
  const double big = cbrt(abs(r) + sqrt(max(r * r - q3, 0.0)));
  const double a = r < 0 ? big : -big, b = a != 0 ? q / a : 0;
  return a + b - c2 / 3;
}

/// Real roots of q0 + .. + q4 t^4 (Ferrari); their number, at most 4. Roots that meet may be lost.
inline int quartic_roots(const double q[5], double roots[4]) {
  double scale = 0;
  for (int i = 0; i < 5; ++i) scale = max(scale, abs(q[i]));
  if (!(abs(q[4]) > 1e-14 * scale)) return 0;
  const double a = q[3] / q[4], b = q[2] / q[4], c = q[1] / q[4], d = q[0] / q[4];
  // t = y - a / 4: y^4 + f y^2 + g y + h
  const double f = b - 0.375 * a * a, g = c - 0.5 * a * b + 0.125 * a * a * a;
  const double h = d - 0.25 * a * c + a * a * b / 16 - 3 * a * a * a * a / 256;
  // (y^2 + m y + ..)(y^2 - m y + ..), m^2 the largest root of the resolvent
  const double m2 = max(largest_cubic_root(2 * f, f * f - 4 * h, -g * g), 1e-300), m = sqrt(m2);
  int count = 0;
  for (int side = 0; side < 2; ++side) {
    const double half = side ? -0.5 * m : 0.5 * m;  // y^2 + 2 half y + rest
    const double rest = 0.5 * (f + m2) - (side ? -1 : 1) * g / (2 * m);
    const double discriminant = half * half - rest;
    if (discriminant < -1e-10 * (half * half + abs(rest))) continue;
    const double root = sqrt(max(discriminant, 0.0));
    roots[count++] = -half + root - 0.25 * a;
    roots[count++] = -half - root - 0.25 * a;
  }
  return count;
}

/// Newton's step on the quartic at t; 0 where the slope vanishes.
STICKSLIP_INLINE double quartic_step(const double q[5], double t) {
  const double value = q[0] + t * (q[1] + t * (q[2] + t * (q[3] + t * q[4])));
  const double slope = q[1] + t * (2 * q[2] + t * (3 * q[3] + t * 4 * q[4]));
  return slope != 0 ? -value / slope : 0;
}

template <bool kMaxDissipation>
inline SlipSolution solve_quartic(const LocalContact<double>& k, const Reduced<double>& reduced,
                                  double tolerance, int polish = 2) {
  const SlipProblem p = slip_problem(k, reduced);
  const double length = 1 / sqrt(p.stick_x * p.stick_x + p.stick_y * p.stick_y);
  const SlipQuartic<double> s =
      slip_quartic<kMaxDissipation>(k, reduced, p.stick_x * length, p.stick_y * length);
  const double coefficients[5] = {s.q0, s.q1, s.q2, s.q3, s.q4};
  double roots[4];
  const int count = quartic_roots(coefficients, roots);
  ConicPoint best{s.ex, s.ey, 1 + p.mu * (p.wx * s.ex + p.wy * s.ey), 0};
  best.r = p.mu * p.a / best.d;
  double best_value = 1e300, best_tau = 0;
  bool found = false;
  for (int i = 0; i < count; ++i) {
    double t = roots[i];
    for (int k = 0; k < polish; ++k) t += quartic_step(coefficients, t);
    const double inv = 1 / (1 + t * t), cosine = (1 - t * t) * inv, sine = 2 * t * inv;
    ConicPoint q{cosine * s.ex - sine * s.ey, cosine * s.ey + sine * s.ex, 0, 0};
    q.d = 1 + p.mu * (p.wx * q.x + p.wy * q.y);
    if (!(q.d > 0)) continue;  // the branch that does not exist
    q.r = p.mu * p.a / q.d;
    double value;
    if constexpr (!kMaxDissipation) {
      // Sliding must oppose friction, v_T = -alpha e with alpha >= 0; of several solutions the one
      // nearest to sticking.
      const double vx = p.sxx * q.r * q.x + p.sxy * q.r * q.y + p.bx,
                   vy = p.sxy * q.r * q.x + p.syy * q.r * q.y + p.by;
      value = -(vx * q.x + vy * q.y);
      if (value < 0) continue;
    } else {
      value = conic_energy(p, q);
    }
    if (value < best_value) best_value = value, best = q, best_tau = t, found = true;
  }
  if (!found) return slip_solution(p, best, 1, false);
  // What another Newton step would change, as an impulse (C14): |d lambda / d theta| = r |e + mu w|
  // |(1, w)| / d at most.
  const double turn = 2 * abs(quartic_step(coefficients, best_tau)) / (1 + best_tau * best_tau);
  const double nx = best.x + p.mu * p.wx, ny = best.y + p.mu * p.wy;
  const double speed =
      best.r / best.d * sqrt((nx * nx + ny * ny) * (1 + p.wx * p.wx + p.wy * p.wy));
  return slip_solution(p, best, 1, turn * speed <= tolerance);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
