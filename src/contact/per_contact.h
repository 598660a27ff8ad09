// Per-contact iteration: nonlinear block SOR, [Hwangbo 2018] Algorithm 2, any single-contact
// method.
//
//   lambda_i <- alpha lambda_i* + (1 - alpha) lambda_i,   lambda_i* solves contact i with the
//   others held alpha <- alpha_min + gamma (alpha - alpha_min)        after each sweep
// Where we differ from the printed algorithm (docs/theory/contact.md, section 4): c_i is rebuilt
// from the newest impulses at each visit; sticking needs lambda_z >= 0 besides the cone; mu = 0
// slides with lambda_T = 0. The default is alpha = gamma = 1: relaxation costs sweeps and leaves
// complementarity asymptotic.
#pragma once
#include "contact/explicit_problem.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

template <Method method, bool kMaxDissipation>
inline void per_contact_sweep(ExplicitProblem& p, double alpha, const SweepOptions& o,
                              double& updates) {
  for (int i = 0; i < p.n; ++i) {
    const LocalContact<double>& k = p.local[i];
    double c[3];
    velocity_without_own(p, i, c);
    double tolerance = 0.1 * o.tolerance;  // Halley: velocity [m/s]
    if (method != Method::kHalley) tolerance = k.scale > 0 ? tolerance / (3 * k.scale) : 1;
    if (o.local_tolerance > 0)
      tolerance = method == Method::kHalley ? o.local_tolerance * k.scale : o.local_tolerance;
    const SlipSolution s = solve_single<method, kMaxDissipation>(k, c, tolerance);
    const double* l = p.lambda + 3 * i;
    const double d[3] = {alpha * (s.x - l[0]), alpha * (s.y - l[1]), alpha * (s.z - l[2])};
    const double size = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    if (!(size > 0)) continue;
    updates += sqrt(size);
    add_impulse(p, i, d);
  }
}

/// Sweeps until the stop test is met; `p` must be prepared. The result's error and status refer to
/// p.lambda as left.
template <Method method, bool kMaxDissipation>
inline SweepResult per_contact(ExplicitProblem& p, const SweepOptions& o) {
  SweepResult r;
  double alpha = o.alpha;
  while (r.sweeps < o.max_sweeps) {
    double updates = 0;
    per_contact_sweep<method, kMaxDissipation>(p, alpha, o, updates);
    alpha = o.alpha_min + o.gamma * (alpha - o.alpha_min);
    if (end_sweep(p, o, updates, r)) break;
  }
  return r;
}

/// The same with method and law from the options. Golden section has no Coulomb form: such options
/// do nothing.
inline SweepResult per_contact(ExplicitProblem& p, const SweepOptions& o) {
  SweepResult r;
  with_method(o.method, o.max_dissipation, [&](auto m, auto law) {
    r = per_contact<decltype(m)::value, decltype(law)::value>(p, o);
  });
  return r;
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
