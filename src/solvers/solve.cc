// The public contact API on top of the methods: memory, choice of method, certificate
// (docs/theory/solvers.md, sections 7 to 9).
#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>

#include "contact/method_of.h"
#include "contact/per_contact.h"
#include "contact/pgs.h"
#include "solvers/admm.h"
#include "solvers/certify.h"
#include "solvers/chain.h"
#include "solvers/explicit_view.h"
#include "solvers/interior_point.h"
#include "solvers/minimum_norm.h"
#include "solvers/prox_newton.h"
#include "solvers/validate.h"

namespace stickslip {
namespace {

using contact::ExplicitProblem;
using solvers::BestImpulse;
using solvers::Effort;

bool is_max_dissipation(FrictionLaw law) { return law == FrictionLaw::kMaxDissipation; }

/// What the residual may be at most [m/s].
double allowed_residual(const ContactProblem& problem, const SolveOptions& o) {
  double fastest = 0;
  for (double c : problem.free_velocity) fastest = std::max(fastest, std::fabs(c));
  return o.tolerance + o.relative_tolerance * fastest;
}

contact::SweepOptions sweep_options(const SolveOptions& o, double tolerance) {
  contact::SweepOptions s;
  s.max_dissipation = is_max_dissipation(o.law);
  s.method = contact::method_of(o.single_contact);
  s.stop = static_cast<contact::StopTest>(o.stop);
  s.tolerance = tolerance, s.max_sweeps = o.max_sweeps;
  s.alpha = o.alpha, s.alpha_min = o.alpha_min, s.gamma = o.gamma;
  s.local_tolerance = o.single_contact_tolerance;
  return s;
}
static_assert(int(StopTest::kResidual) == int(contact::StopTest::kResidual) &&
              int(StopTest::kViolationSum) == int(contact::StopTest::kViolationSum) &&
              int(StopTest::kUpdateSum) == int(contact::StopTest::kUpdateSum));

/// One sweep loop, by the paper's methods. The history takes the residual of each sweep, which
/// costs nothing where it is the stop test; then the best sweep is kept, not the last.
void run_sweeps(ExplicitProblem& p, const SolveOptions& o, BestImpulse& best, Effort& effort) {
  contact::SweepOptions s = sweep_options(o, best.tolerance());
  struct Record {
    ExplicitProblem& p;
    BestImpulse& best;
    bool by_residual;
  } record{p, best, o.stop == StopTest::kResidual && !best.max_dissipation()};
  if (best.records() || record.by_residual) {
    s.history = &record;
    s.record = [](void* to, double error) {
      auto& [problem, b, by_residual] = *static_cast<Record*>(to);
      const double r = by_residual ? error : reachable_residual(problem, b.max_dissipation());
      if (by_residual) b.keep(problem, SolveStage::kSweeps, r);
      b.record(SolveStage::kSweeps, r);
    };
  }
  effort.sweeps +=
      (o.method == SolveMethod::kPgs ? contact::pgs(p, s) : contact::per_contact(p, s)).sweeps;
  best.offer(p, SolveStage::kSweeps, true);
}

void run_method(ExplicitProblem& p, const SolveOptions& o, BestImpulse& best, Effort& effort) {
  const auto limit = [&](int standard) {
    return o.max_iterations > 0 ? o.max_iterations : standard;
  };
  switch (o.method) {
    case SolveMethod::kAuto:
      return run_chain(p, best, o.max_sweeps, effort);
    case SolveMethod::kPerContact:
    case SolveMethod::kPgs:
      return run_sweeps(p, o, best, effort);
    case SolveMethod::kProxNewton: {
      solvers::ProxNewton method(p);
      method.run(best, o.proximal_weight, limit(500));
      effort.newton_steps = method.steps();
      return;
    }
    case SolveMethod::kInteriorPoint: {
      solvers::InteriorPoint method(p);
      method.run(best, o.shift, limit(100));
      effort.interior_point_steps = method.iterations();
      return;
    }
    case SolveMethod::kAdmm: {
      solvers::Admm method(p);
      method.run(best, limit(5000));
      effort.admm_iterations = method.iterations();
      return;
    }
  }
}

/// A contact that cannot push but is driven into the ground.
bool infeasible(const ExplicitProblem& p, double tolerance) {
  for (int i = 0; i < p.n; ++i)
    if (!(p.local[i].inv_zz > 0) && p.v[3 * i + 2] < -tolerance) return true;
  return false;
}

SolveStatus status_of(const ExplicitProblem& p, const SolveOptions& o, double residual,
                      double tolerance) {
  if (residual <= tolerance) return SolveStatus::kConverged;
  if (infeasible(p, tolerance)) return SolveStatus::kInfeasible;
  return o.method == SolveMethod::kAuto ? SolveStatus::kStalled : SolveStatus::kIterationLimit;
}

/// Changes p.lambda by `change`, and back if the residual then exceeds `allowed`. p.v is up to date
/// afterwards.
template <class F>
bool improve(ExplicitProblem& p, double allowed, F&& change) {
  const std::vector<double> kept(p.lambda, p.lambda + 3 * p.n);
  change();
  contact::refresh_velocity(p);
  if (reachable_residual(p, false) <= allowed) return true;
  std::copy(kept.begin(), kept.end(), p.lambda);
  contact::refresh_velocity(p);
  return false;
}

/// The certificate of p.lambda. A method that approaches the cones from inside may leave contacts
/// near to sliding or to opening, where the residual is small and the backward error is not: then
/// they are settled.
Certificate settled_certificate(ExplicitProblem& p, const SolveOptions& o, double tolerance) {
  Certificate c = solvers::certify(p, is_max_dissipation(o.law));
  if (is_max_dissipation(o.law) || c.backward_error <= 2 * std::max(tolerance, c.residual))
    return c;
  if (improve(p, std::max(tolerance, c.residual), [&] { solvers::settle_on_cones(p); }))
    c = solvers::certify(p, false);
  return c;
}

}  // namespace

SolveResult solve(const ContactProblem& problem, const SolveOptions& options,
                  const std::vector<double>& warm_start) {
  options.validate();
  problem.validate();
  const int n = problem.num_contacts();
  if (!warm_start.empty()) solvers::check_impulse("the warm start", warm_start, n);
  const bool max_dissipation = is_max_dissipation(options.law);
  const double tolerance = allowed_residual(problem, options);

  SolveResult r;
  Effort effort;
  solvers::ExplicitView e(problem, warm_start);
  BestImpulse best(tolerance, max_dissipation, options.record_history ? &r.history : nullptr);
  const bool by_residual =
      options.stop == StopTest::kResidual ||
      (options.method != SolveMethod::kPerContact && options.method != SolveMethod::kPgs);
  // What costs nothing to try: the start itself.
  const bool tried = !warm_start.empty() || n == 0 || options.method != SolveMethod::kAuto;
  if (!(tried && best.offer(e.view, SolveStage::kStart) && by_residual))
    run_method(e.view, options, best, effort);
  // Everything reported is recomputed from the impulse that is returned.
  best.restore(e.view);
  if (options.minimum_norm)
    improve(e.view, std::max(tolerance, best.residual()), [&] {
      solvers::minimize_tangential_impulses(e.view, std::max(tolerance, 10 * best.residual()));
    });
  r.certificate = best.stage() == SolveStage::kStart
                      ? solvers::certify(e.view, max_dissipation)
                      : settled_certificate(e.view, options, tolerance);
  r.velocity.assign(e.view.v, e.view.v + 3 * n);
  r.impulse.assign(e.view.lambda, e.view.lambda + 3 * n);
  r.stage = best.stage();
  r.status = status_of(e.view, options, r.certificate.residual, tolerance);
  r.sweeps = effort.sweeps, r.newton_steps = effort.newton_steps;
  r.interior_point_steps = effort.interior_point_steps;
  r.admm_iterations = effort.admm_iterations;
  return r;
}

std::vector<double> residual(const ContactProblem& problem, const std::vector<double>& impulse,
                             FrictionLaw law) {
  return certify(problem, impulse, law).residuals;
}

Certificate certify(const ContactProblem& problem, const std::vector<double>& impulse,
                    FrictionLaw law) {
  problem.validate();
  solvers::check_impulse("the impulse", impulse, problem.num_contacts());
  const solvers::ExplicitView e(problem, impulse);
  return solvers::certify(e.view, is_max_dissipation(law));
}

SingleContactResult solve_contact(const double delassus[9], const double free_velocity[3],
                                  double friction, const SingleContactOptions& options) {
  const ContactProblem problem{
      {delassus, delassus + 9}, {free_velocity, free_velocity + 3}, {friction}};
  problem.validate();
  solvers::check_single(options.method, options.law, "solve_contact");
  if (!(options.tolerance > 0)) throw ModelError("solve_contact: the tolerance must be positive");
  const solvers::ExplicitView e(problem, {});
  const double* c = free_velocity;
  const double speed = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
  const bool halley = options.method == SingleContactMethod::kHalley;
  const double stop = halley ? options.tolerance * speed : options.tolerance;
  SingleContactResult r{};
  contact::with_method(
      contact::method_of(options.method), is_max_dissipation(options.law), [&](auto m, auto law) {
        const auto s = contact::solve_single<decltype(m)::value, decltype(law)::value>(
            e.view.local[0], c, stop);
        r.impulse[0] = s.x, r.impulse[1] = s.y, r.impulse[2] = s.z;
        r.evaluations = s.evaluations, r.converged = s.converged;
      });
  return r;
}

}  // namespace stickslip
