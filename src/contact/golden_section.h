// Golden section search for a sliding impulse of least energy, as Preclik describes it ([Preclik
// 2014], [Preclik 2017]).
//
// Energy values alone are compared, so the angle cannot be known better than sqrt(rounding): about
// 1e-8 of |lambda|. The search interval is the intersection of two arcs, found with inverse
// trigonometric functions as he does (the "initial overhead" of [Hwangbo 2018] section VI): I,
// where the radius is positive (the branch), and J, in line of sight of the stick impulse. It
// minimizes eq. 8; Coulomb's law (eq. 6) is no minimization, so there is no Coulomb form.
#pragma once
#include "contact/slip.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// An arc of angles [left, right], right - left <= 2 pi [rad].
struct Arc {
  double left, right;
};

/// Arc of half width `half` about `center`, turned so that its left end lies in [0, 2 pi).
STICKSLIP_INLINE Arc make_arc(double center, double half) {
  constexpr double kTurn = 6.28318530717958647693;
  Arc arc{center - half, center + half};
  if (arc.left < 0) arc.left += kTurn, arc.right += kTurn;
  return arc;
}

/// Intersection of two arcs that overlap in one piece.
STICKSLIP_INLINE Arc intersect(Arc a, Arc b) {
  constexpr double kTurn = 6.28318530717958647693;
  if (a.left > b.left) {
    const Arc t = a;
    a = b, b = t;
  }
  if (b.left > a.right) {
    // b starts beyond a's end: seen from the left it is the arc one turn earlier.
    b.right -= kTurn;
    return {a.left, min(a.right, b.right)};
  }
  return {b.left, min(a.right, b.right)};
}

/// Interval that holds the minimum: branch I cut with line of sight J.
STICKSLIP_INLINE Arc golden_interval(const SlipProblem& p) {
  constexpr double kPi = 3.14159265358979323846;
  const double w = p.mu * sqrt(p.wx * p.wx + p.wy * p.wy);
  const double center_i = atan2(p.wy, p.wx), center_j = atan2(p.stick_y, p.stick_x);
  const double k = min(sight_cosine(p), 1.0);
  if (w > 1) {
    const Arc branch = make_arc(center_i, acos(-1 / w));
    return k < -1 ? branch : intersect(branch, make_arc(center_j, acos(k)));
  }
  return make_arc(center_j, k < -1 ? kPi : acos(k));
}

inline SlipSolution solve_golden_section(const SlipProblem& p, double tolerance) {
  constexpr double kRatio = 0.61803398874989484820;
  constexpr double kHuge = 1e300;
  constexpr int kMaxEvaluations = 200;
  Arc arc = golden_interval(p);
  const auto energy = [&p](const ConicPoint& q) { return q.d > 0 ? conic_energy(p, q) : kHuge; };
  double inner_left = arc.right - kRatio * (arc.right - arc.left),
         inner_right = arc.left + kRatio * (arc.right - arc.left);
  ConicPoint left = conic_point(p, inner_left), right = conic_point(p, inner_right);
  double energy_left = energy(left), energy_right = energy(right);
  int evaluations = 2;
  // The end of the interval on the side that has not moved yet is not an evaluated point; the
  // interval counts as open.
  ConicPoint end_left = left, end_right = right;
  bool moved_left = false, moved_right = false, converged = false;
  while (evaluations < kMaxEvaluations) {
    if (energy_left < energy_right) {
      arc.right = inner_right, end_right = right, moved_right = right.d > 0;
      inner_right = inner_left, right = left, energy_right = energy_left;
      inner_left = arc.right - kRatio * (arc.right - arc.left);
      left = conic_point(p, inner_left), energy_left = energy(left);
    } else {
      arc.left = inner_left, end_left = left, moved_left = left.d > 0;
      inner_left = inner_right, left = right, energy_left = energy_right;
      inner_right = arc.left + kRatio * (arc.right - arc.left);
      right = conic_point(p, inner_right), energy_right = energy(right);
    }
    ++evaluations;
    converged = moved_left && moved_right &&
                impulse_distance2(p, end_left, end_right) < tolerance * tolerance;
    if (converged || arc.right - arc.left < 1e-14) break;
  }
  const ConicPoint best = energy_left < energy_right ? left : right;
  // Below sqrt(rounding) energies are equal and the search wanders: such an answer is not called
  // converged.
  const double resolution = 3e-8 * best.r;
  return slip_solution(
      p, best, evaluations,
      best.d > 0 && (converged || moved_left != moved_right) && tolerance > resolution);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
