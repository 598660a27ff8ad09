// Where sweeps and Newton steps stall (hyperstatic contact): proximal point method with damped
// semismooth Newton steps, in double, one problem at a time (docs/theory/solvers.md (C35)-(C38)).
//
// Outer loop: lambda_(k+1) solves the problem with u + alpha scale (lambda - lambda_k) in place of
// u; alpha shrinks after each solved subproblem, also where the residual has not halved (a
// residual-driven rule loses stacks), and grows after a failure. Inner loop: Newton with
// non-monotone backtracking over four steps. Between starts, sweeps. The best point wins.
#pragma once
#include "contact/newton.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

template <int M>
class Fallback {
 public:
  Fallback(FactoredProblem<double>& p, double tolerance) : p_(p), tolerance_(tolerance) {}

  /// Improves the impulses in the problem until the largest residual is at most the tolerance
  /// [m/s]; true if it is.
  bool run() {
    best_residual_ = 1e300;
    accumulate<M>(p_);
    if (keep_if_better()) return true;
    if (!(best_residual_ < 1e300)) {
      clear();
      if (keep_if_better()) return true;
    }
    // First from where the sweeps ended, then from rest with other weights. Weights and shrinking
    // by measurement on 8- to 12-contact impacts: faster shrinking loses some, a smaller first
    // weight costs steps.
    constexpr double kStarts[] = {1e-3, 1e-1, 1e-5, 1.0, 30.0};
    for (int round = 0; round < 2; ++round) {
      for (double start : kStarts) {
        if (proximal_point(start, round == 0 ? 0.4 : 0.15)) return true;
        restore(best());
        for (int k = 0; k < 60; ++k) sweep<M, false>(p_, true, 0.01 * tolerance_);
        accumulate<M>(p_);
        if (keep_if_better()) return true;
        if (round == 1) clear();
      }
      clear();
    }
    restore(best());
    return false;
  }
  int steps() const { return steps_; }

 private:
  // Slots of p.saved.
  double* best() { return p_.saved; }
  double* center() { return p_.saved + 3 * p_.size(); }
  double* origin() { return p_.saved + 6 * p_.size(); }
  double* step() { return p_.saved + 9 * p_.size(); }

  void save(double* to) {
    for (int i = 0; i < p_.size(); ++i) store(p_.contact(i).lambda, to + 3 * i);
  }
  void restore(const double* from) {
    for (int i = 0; i < p_.size(); ++i) set_impulse(p_.contact(i), from + 3 * i);
    accumulate<M>(p_);
  }
  void clear() {
    const double none[3] = {};
    for (int i = 0; i < p_.size(); ++i) set_impulse(p_.contact(i), none);
    accumulate<M>(p_);
  }
  /// As `certify` has it: the largest residual, plus the most that the rounding of an impulse
  /// hides.
  double residual() {
    double worst = 0, hidden = 0, sum = 0;
    for (int i = 0; i < p_.size(); ++i) {
      const FactoredContact<double>& c = p_.contact(i);
      double v[3], l[3];
      contact_velocity<M>(c, p_.w, v);
      store(c.lambda, l);
      const double e = natural_map_residual_squared(c.local, v, l);
      worst = max(worst, e);
      hidden = max(hidden, impulse_rounding(c.local, l));
      sum += e;
    }
    return sqrt(worst) + hidden + 0 * sum;  // NaN if any is
  }
  bool keep_if_better() {
    const double r = residual();
    if (r < best_residual_) {
      best_residual_ = r;
      save(best());
    }
    return best_residual_ <= tolerance_;
  }
  /// Norm of the Alart-Curnier map of the proximal subproblem [m/s].
  double merit(double alpha) {
    double sum = 0;
    for (int i = 0; i < p_.size(); ++i) {
      const FactoredContact<double>& c = p_.contact(i);
      double v[3], l[3];
      contact_velocity<M>(c, p_.w, v);
      store(c.lambda, l);
      const double scale = c.local.scale;
      for (int r = 0; r < 3; ++r) v[r] += alpha * scale * (l[r] - center()[3 * i + r]);
      const double s = max(scale * l[2] - v[2], 0.0), t0 = scale * l[0] - v[0],
                   t1 = scale * l[1] - v[1];
      const double norm = sqrt(t0 * t0 + t1 * t1), limit = c.local.mu * s;
      const double f = norm > limit ? limit / norm : 1;
      const double dz = scale * l[2] - s, dx = scale * l[0] - f * t0, dy = scale * l[1] - f * t1;
      sum += dx * dx + dy * dy + dz * dz;
    }
    return sqrt(sum);
  }
  void newton_direction(double alpha) {
    eliminate_contacts<M>(p_, true, alpha, center(),
                          [&](FactoredContact<double>& c) { bring_contact<M>(p_, c); });
    const double* x = solve_shared<M>(p_);
    for (int i = 0; i < p_.size(); ++i) {
      const FactoredContact<double>& c = p_.contact(i);
      double dv[3], response[3];
      change_of<M>(c, x, dv);
      store(madd(c.n_columns[2], dv[2], madd(c.n_columns[1], dv[1], c.n_columns[0] * dv[0])),
            response);
      for (int r = 0; r < 3; ++r) step()[3 * i + r] = -(c.n_offset[r] + response[r]);
    }
  }
  void move(double t) {
    for (int i = 0; i < p_.size(); ++i) {
      double l[3];
      for (int r = 0; r < 3; ++r) l[r] = origin()[3 * i + r] + t * step()[3 * i + r];
      set_impulse(p_.contact(i), l);
    }
    accumulate<M>(p_);
  }
  void project_on_cones() {
    for (int i = 0; i < p_.size(); ++i) {
      FactoredContact<double>& c = p_.contact(i);
      double l[3];
      store(c.lambda, l);
      l[2] = max(l[2], 0.0);
      const double norm = sqrt(l[0] * l[0] + l[1] * l[1]), limit = c.local.mu * l[2];
      if (norm > limit) l[0] *= limit / norm, l[1] *= limit / norm;
      set_impulse(c, l);
      reset_direction(c, l);
    }
    accumulate<M>(p_);
  }
  /// Newton on one subproblem; true if solved to a tenth of the tolerance.
  bool subproblem(double alpha) {
    double history[4];
    double m = merit(alpha);
    for (int inner = 0; inner < 30; ++inner) {
      if (m < 0.1 * tolerance_) return true;
      history[inner & 3] = m;
      double worst = 0;
      for (int h = 0; h < (inner < 3 ? inner + 1 : 4); ++h) worst = max(worst, history[h]);
      newton_direction(alpha);
      ++steps_;
      save(origin());
      double t = 1;
      bool accepted = false;
      for (int b = 0; b < 9 && !accepted; ++b, t *= 0.5) {
        move(t);
        m = merit(alpha);
        accepted = m < worst * (1 - 1e-4 * t);  // false for NaN
      }
      if (!accepted) {
        restore(origin());
        return false;
      }
    }
    return false;
  }
  bool proximal_point(double alpha, double shrink) {
    int failures = 0;
    for (int outer = 0; outer < 25; ++outer) {
      save(center());
      const bool solved = subproblem(alpha);
      project_on_cones();
      if (keep_if_better()) return true;
      if (solved) {
        alpha *= shrink;
      } else {
        alpha = min(alpha * 10, 1e3);
        if (++failures > 4) break;
        restore(best());
      }
    }
    return false;
  }

  FactoredProblem<double>& p_;
  double tolerance_, best_residual_ = 1e300;
  int steps_ = 0;
};

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
