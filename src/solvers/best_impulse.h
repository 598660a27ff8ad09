// The best impulse of a solve so far, and the record of how it came about. Methods may end on a
// worse point than they have seen; the caller never gets that (docs/theory/solvers.md, section 7).
// Velocities by (C27), residuals by (C3) or (C25).
#pragma once
#include <stickslip/contact.h>

#include <chrono>
#include <vector>

#include "contact/explicit_problem.h"
#include "solvers/cones.h"
#include "solvers/memory.h"

namespace stickslip::solvers {

class BestImpulse {
 public:
  /// `history`: where each offer is recorded, or null.
  BestImpulse(double tolerance, bool max_dissipation, std::vector<HistoryEntry>* history,
              Memory memory = std::pmr::get_default_resource())
      : tolerance_(tolerance),
        max_dissipation_(max_dissipation),
        impulse_(memory),
        history_(history) {
    if (history_) start_ = Clock::now();
  }

  /// Takes p.lambda, projected on its cones, if its residual is the least so far; p.v is up to date
  /// afterwards. True once an impulse within the tolerance has been seen. `recorded`: the history
  /// has this point already.
  bool offer(contact::ExplicitProblem& p, SolveStage stage, bool recorded = false) {
    project_on_cones(p);
    contact::refresh_velocity(p);
    last_ = reachable_residual(p, max_dissipation_);
    if (!(last_ < __builtin_inf())) last_ = __builtin_inf();
    if (!recorded) record(stage, last_);
    keep(p, stage, last_);
    return solved();
  }
  /// The same for an impulse in its cones whose residual is known.
  void keep(const contact::ExplicitProblem& p, SolveStage stage, double residual) {
    if (!(residual < residual_ || !has_one_)) return;
    has_one_ = true;
    residual_ = residual;
    stage_ = stage;
    if (residual < __builtin_inf())
      impulse_.assign(p.lambda, p.lambda + 3 * p.n);
    else
      impulse_.assign(3 * p.n, 0.0);
  }
  /// Puts the best impulse back into the problem; p.v is up to date afterwards.
  void restore(contact::ExplicitProblem& p) const {
    for (int i = 0; i < 3 * p.n; ++i) p.lambda[i] = impulse_[i];
    contact::refresh_velocity(p);
  }
  /// Records the residual of p.lambda brought into its cones; leaves the problem as it is.
  void record_projected(contact::ExplicitProblem& p, SolveStage stage) {
    const std::vector<double> impulse(p.lambda, p.lambda + 3 * p.n), v(p.v, p.v + 3 * p.n);
    project_on_cones(p);
    contact::refresh_velocity(p);
    record(stage, reachable_residual(p, max_dissipation_));
    for (int r = 0; r < 3 * p.n; ++r) p.lambda[r] = impulse[r], p.v[r] = v[r];
  }
  /// Takes p.lambda whatever it is worth: the answers of islands, none of which is worse than what
  /// it replaces.
  void replace(contact::ExplicitProblem& p, SolveStage stage) {
    has_one_ = false;
    offer(p, stage);
  }
  void record(SolveStage stage, double residual) {
    if (!history_) return;
    const std::chrono::duration<double> time = Clock::now() - start_;
    history_->push_back({stage, time.count(), residual});
  }

  bool solved() const { return has_one_ && residual_ <= tolerance_; }
  double tolerance() const { return tolerance_; }
  double residual() const { return residual_; }
  double last_residual() const { return last_; }
  bool max_dissipation() const { return max_dissipation_; }
  bool records() const { return history_ != nullptr; }
  SolveStage stage() const { return stage_; }
  const Doubles& impulse() const { return impulse_; }

 private:
  using Clock = std::chrono::steady_clock;
  double tolerance_, residual_ = __builtin_inf(), last_ = __builtin_inf();
  bool max_dissipation_, has_one_ = false;
  SolveStage stage_ = SolveStage::kStart;
  Doubles impulse_;
  std::vector<HistoryEntry>* history_;
  Clock::time_point start_;
};

}  // namespace stickslip::solvers
