// The sweep loops of [Hwangbo 2018], Algorithm 2 and eq. 17 and 18, with a history, and with the
// best sweep kept where its residual is known.
#pragma once
#include "contact/per_contact.h"
#include "contact/pgs.h"
#include "solvers/best_impulse.h"

namespace stickslip::solvers {

/// The history takes the residual of each sweep, which costs nothing where it is the stop test;
/// then the best sweep is kept, not the last. Overrelaxed sweeps leave the cones: of those only the
/// last counts, projected.
inline contact::SweepResult recorded_sweeps(contact::ExplicitProblem& p, contact::SweepOptions o,
                                            BestImpulse& best, bool pgs) {
  struct Record {
    contact::ExplicitProblem& p;
    BestImpulse& best;
    bool by_residual;
  } record{p, best,
           o.alpha <= 1 && o.alpha_min <= 1 && !o.max_dissipation &&
               o.stop == contact::StopTest::kResidual};
  if (best.records() || record.by_residual) {
    o.history = &record;
    o.record = [](void* to, double error) {
      auto& [problem, b, by_residual] = *static_cast<Record*>(to);
      const double r = by_residual ? error : reachable_residual(problem, b.max_dissipation());
      if (by_residual) b.keep(problem, SolveStage::kSweeps, r);
      b.record(SolveStage::kSweeps, r);
    };
  }
  return pgs ? contact::pgs(p, o) : contact::per_contact(p, o);
}

}  // namespace stickslip::solvers
