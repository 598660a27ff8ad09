// The public contact API on top of the methods: memory, choice of method, certificate
// (docs/theory/solvers.md, sections 7 to 9).
#include "solvers/solve.h"

#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "solvers/admm.h"
#include "solvers/certify.h"
#include "solvers/chain.h"
#include "solvers/explicit_view.h"
#include "solvers/interior_point.h"
#include "solvers/method_of.h"
#include "solvers/minimum_norm.h"
#include "solvers/prox_newton.h"
#include "solvers/recorded_sweeps.h"
#include "solvers/validate.h"

namespace stickslip {
namespace {

using contact::ExplicitProblem;
using solvers::BestImpulse;
using solvers::Effort;

constexpr std::size_t kStackBytes = 1 << 14;

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
  s.method = solvers::method_of(o.single_contact);
  s.stop = static_cast<contact::StopTest>(o.stop);
  s.tolerance = tolerance, s.max_sweeps = o.max_sweeps;
  s.alpha = o.alpha, s.alpha_min = o.alpha_min, s.gamma = o.gamma;
  s.local_tolerance = o.single_contact_tolerance;
  return s;
}
static_assert(int(StopTest::kResidual) == int(contact::StopTest::kResidual) &&
              int(StopTest::kViolationSum) == int(contact::StopTest::kViolationSum) &&
              int(StopTest::kUpdateSum) == int(contact::StopTest::kUpdateSum));

void run_sweeps(ExplicitProblem& p, const SolveOptions& o, BestImpulse& best, Effort& effort) {
  const contact::SweepOptions s = sweep_options(o, best.tolerance());
  effort.sweeps += solvers::recorded_sweeps(p, s, best, o.method == SolveMethod::kPgs).sweeps;
  best.offer(p, SolveStage::kSweeps, true);
}

/// Of a method chosen by name.
int iteration_limit(const SolveOptions& o) {
  if (o.max_iterations > 0) return o.max_iterations;
  return o.method == SolveMethod::kProxNewton      ? 500
         : o.method == SolveMethod::kInteriorPoint ? 100
                                                   : 5000;
}

void run_method(ExplicitProblem& p, const SolveOptions& o, BestImpulse& best, Effort& effort,
                solvers::Memory memory) {
  switch (o.method) {
    case SolveMethod::kAuto:
      return run_chain(p, best, o.max_sweeps, effort, memory);
    case SolveMethod::kPerContact:
    case SolveMethod::kPgs:
      return run_sweeps(p, o, best, effort);
    case SolveMethod::kProxNewton: {
      solvers::ProxNewton method(p);
      method.run(best, o.proximal_weight, iteration_limit(o));
      effort.newton_steps = method.steps();
      return;
    }
    case SolveMethod::kInteriorPoint: {
      solvers::InteriorPoint method(p);
      method.run(best, o.shift, iteration_limit(o));
      effort.interior_point_steps = method.iterations();
      return;
    }
    case SolveMethod::kAdmm: {
      solvers::Admm method(p);
      method.run(best, iteration_limit(o));
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

/// The method stopped because it had used up its sweeps or iterations, and not because it saw no
/// way on.
bool used_up(const SolveOptions& o, const Effort& e) {
  switch (o.method) {
    case SolveMethod::kPerContact:
    case SolveMethod::kPgs:
      return e.sweeps >= o.max_sweeps;
    case SolveMethod::kProxNewton:
      return e.newton_steps >= iteration_limit(o);
    case SolveMethod::kInteriorPoint:
      return e.interior_point_steps >= iteration_limit(o);
    case SolveMethod::kAdmm:
      return e.admm_iterations >= iteration_limit(o);
    default:
      return false;
  }
}

SolveStatus status_of(const ExplicitProblem& p, const SolveOptions& o, const Effort& effort,
                      double residual, double tolerance) {
  if (residual <= tolerance) return SolveStatus::kConverged;
  if (infeasible(p, tolerance)) return SolveStatus::kInfeasible;
  return used_up(o, effort) ? SolveStatus::kIterationLimit : SolveStatus::kStalled;
}

/// Changes p.lambda by `change`, and back if the residual then exceeds the tolerance. p.v is up to
/// date afterwards.
template <class F>
bool improve(ExplicitProblem& p, double tolerance, F&& change) {
  const std::vector<double> kept(p.lambda, p.lambda + 3 * p.n);
  change();
  solvers::project_on_cones(p);
  contact::refresh_velocity(p);
  if (reachable_residual(p, false) <= tolerance) return true;
  std::copy(kept.begin(), kept.end(), p.lambda);
  contact::refresh_velocity(p);
  return false;
}

/// The certificate of a solved p.lambda. A method that approaches the cones from inside may leave
/// contacts near to sliding or to opening, where the residual is small and the backward error is
/// not: then they are settled, as long as the residual stays within the tolerance.
Certificate settled_certificate(ExplicitProblem& p, double tolerance) {
  Certificate c = solvers::certify(p, false);
  if (c.backward_error <= 2 * std::max(tolerance, c.residual)) return c;
  if (improve(p, tolerance, [&] { solvers::settle_on_cones(p); })) c = solvers::certify(p, false);
  return c;
}

/// Offers rest, and before it the caller's start, which p.lambda is: methods go on from that one
/// even where rest is better, since it may know which contacts push; but not where it is absurd.
void offer_starts(ExplicitProblem& p, BestImpulse& best, const std::vector<double>& warm_start) {
  constexpr double kAbsurd = 1e3;
  if (!warm_start.empty() && best.offer(p, SolveStage::kStart)) return;
  const double warm = best.last_residual();
  std::fill(p.lambda, p.lambda + 3 * p.n, 0.0);
  if (best.offer(p, SolveStage::kStart) || warm_start.empty()) return;
  if (!(warm <= kAbsurd * best.last_residual())) return;
  std::copy(warm_start.begin(), warm_start.end(), p.lambda);
  solvers::project_on_cones(p);
  contact::refresh_velocity(p);
}

}  // namespace

namespace solvers {

SolveResult solve_checked(const ContactProblem& problem, const SolveOptions& options,
                          const std::vector<double>& warm_start) {
  options.validate();
  const int n = problem.num_contacts();
  if (!warm_start.empty()) check_impulse("the warm start", warm_start, n);
  const bool max_dissipation = is_max_dissipation(options.law);
  const double tolerance = allowed_residual(problem, options);

  SolveResult r;
  Effort effort;
  ExplicitView e(problem, warm_start);
  // What a robot-sized problem needs beside its own arrays lies on the stack: allocations would
  // take a fifth of its time.
  alignas(64) std::byte block[kStackBytes];
  std::pmr::monotonic_buffer_resource memory(block, sizeof block);
  BestImpulse best(tolerance, max_dissipation, options.record_history ? &r.history : nullptr,
                   &memory);
  const bool sweeps_alone =
      options.method == SolveMethod::kPerContact || options.method == SolveMethod::kPgs;
  const bool by_residual = options.stop == StopTest::kResidual || !sweeps_alone;
  // The chain offers rest itself, if nothing else comes; trying it first would cost as much as a
  // sweep.
  if (!warm_start.empty() || n == 0 || options.method != SolveMethod::kAuto)
    offer_starts(e.view, best, warm_start);
  if (!(best.solved() && by_residual)) run_method(e.view, options, best, effort, &memory);
  // Everything reported is recomputed from the impulse that is returned. The chain stops at the one
  // that solves.
  const bool started = best.stage() == SolveStage::kStart;
  if (!best.solved() || started || options.method != SolveMethod::kAuto) best.restore(e.view);
  if (options.minimum_norm && best.solved()) {
    improve(e.view, tolerance, [&] { spread_impulses(e.view, tolerance); });
    improve(e.view, tolerance, [&] { minimize_tangential_impulses(e.view, tolerance); });
  }
  r.certificate = max_dissipation || started || !best.solved()
                      ? certify(e.view, max_dissipation)
                      : settled_certificate(e.view, tolerance);
  r.velocity.assign(e.view.v, e.view.v + 3 * n);
  r.impulse.assign(e.view.lambda, e.view.lambda + 3 * n);
  r.stage = best.stage();
  r.status = status_of(e.view, options, effort, r.certificate.residual, tolerance);
  r.sweeps = effort.sweeps, r.newton_steps = effort.newton_steps;
  r.interior_point_steps = effort.interior_point_steps;
  r.admm_iterations = effort.admm_iterations;
  return r;
}

Certificate certify_checked(const ContactProblem& problem, const std::vector<double>& impulse,
                            FrictionLaw law) {
  check_impulse("the impulse", impulse, problem.num_contacts());
  const ExplicitView e(problem, impulse);
  return certify(e.view, is_max_dissipation(law));
}

}  // namespace solvers

SolveResult solve(const ContactProblem& problem, const SolveOptions& options,
                  const std::vector<double>& warm_start) {
  problem.validate();
  return solvers::solve_checked(problem, options, warm_start);
}

std::vector<double> residual(const ContactProblem& problem, const std::vector<double>& impulse,
                             FrictionLaw law) {
  return certify(problem, impulse, law).residuals;
}

Certificate certify(const ContactProblem& problem, const std::vector<double>& impulse,
                    FrictionLaw law) {
  problem.validate();
  return solvers::certify_checked(problem, impulse, law);
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
      solvers::method_of(options.method), is_max_dissipation(options.law), [&](auto m, auto law) {
        const auto s = contact::solve_single<decltype(m)::value, decltype(law)::value>(
            e.view.local[0], c, stop);
        r.impulse[0] = s.x, r.impulse[1] = s.y, r.impulse[2] = s.z;
        r.evaluations = s.evaluations, r.converged = s.converged;
      });
  return r;
}

}  // namespace stickslip
