// The public contact API on top of the kernels: memory, choice of method, certificate.
#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>

#include "contact/factored.h"
#include "contact/method_of.h"
#include "contact/per_contact.h"
#include "contact/pgs.h"
#include "contact/validate.h"

namespace stickslip {
namespace {

using contact::ExplicitProblem;

bool is_max_dissipation(FrictionLaw law) { return law == FrictionLaw::kMaxDissipation; }

/// An explicit problem and its memory.
struct Explicit {
  Explicit(const ContactProblem& problem, std::vector<double> start)
      : impulse(std::move(start)),
        workspace(ExplicitProblem::workspace_size(problem.num_contacts()) + 1) {
    view.n = problem.num_contacts();
    view.G = problem.delassus.data(), view.c = problem.free_velocity.data(),
    view.mu = problem.friction.data();
    view.lambda = impulse.data();
    view.attach(workspace.data());
    prepare(view);
  }
  Explicit(const Explicit&) = delete;
  Explicit& operator=(const Explicit&) = delete;

  std::vector<double> impulse, workspace;
  ExplicitProblem view;
};

/// The best impulse so far. Solvers may end on a worse point than they have seen; the caller never
/// gets that.
struct Best {
  std::vector<double> impulse;
  double residual = INFINITY;

  void offer(Explicit& e, bool max_dissipation) {
    refresh_velocity(e.view);
    const double r = largest_residual(e.view, max_dissipation);
    if (r < residual) residual = r, impulse = e.impulse;
  }
};

contact::SweepOptions sweep_options(const SolveOptions& o) {
  contact::SweepOptions s;
  s.max_dissipation = is_max_dissipation(o.law);
  s.method = contact::method_of(o.single_contact);
  s.stop = static_cast<contact::StopTest>(o.stop);
  s.tolerance = o.tolerance, s.max_sweeps = o.max_sweeps;
  s.alpha = o.alpha, s.alpha_min = o.alpha_min, s.gamma = o.gamma;
  s.local_tolerance = o.single_contact_tolerance;
  return s;
}
static_assert(int(StopTest::kResidual) == int(contact::StopTest::kResidual) &&
              int(StopTest::kViolationSum) == int(contact::StopTest::kViolationSum) &&
              int(StopTest::kUpdateSum) == int(contact::StopTest::kUpdateSum));

/// One sweep loop on the explicit form; adds to the result's counts and history.
void run_sweeps(Explicit& e, contact::SweepOptions o, bool pgs, bool record, SolveResult& r) {
  if (record) {
    o.history = &r.history;
    o.record = [](void* history, double error) {
      static_cast<std::vector<double>*>(history)->push_back(error);
    };
  }
  const contact::SweepResult s = pgs ? contact::pgs(e.view, o) : contact::per_contact(e.view, o);
  r.sweeps += s.sweeps;
}

struct Free {
  void operator()(void* p) const { std::free(p); }
};

/// The factored form of G = Y Y^T, solved as a step does; the impulse goes to `e`.
void run_factored(const contact::DenseFactor& f, const ContactProblem& problem,
                  const SolveOptions& o, double tolerance, Explicit& e, SolveResult& r) {
  const int n = problem.num_contacts(), m = f.rank;
  contact::FactoredProblem<double> p;
  const contact::FactoredCapacity capacity{n, m};
  const long bytes = (contact::FactoredProblem<double>::required_bytes(capacity) + 63) / 64 * 64;
  const std::unique_ptr<void, Free> memory(std::aligned_alloc(64, bytes));
  if (!memory) throw std::bad_alloc();
  p.attach(memory.get(), capacity);
  p.clear(m);
  for (int i = 0; i < n; ++i) {
    p.add();
    const double* y = f.y.data() + 3L * i * m;
    for (int k = 0; k < m; ++k) p.y(i)[k] = make_row3(y[k], y[m + k], y[2 * m + k]);
    p.friction(i) = std::min(problem.friction[i], contact::kMaxFriction);
    for (int a = 0; a < 3; ++a) {
      p.offset(i)[a] = problem.free_velocity[3 * i + a];
      p.impulse(i)[a] = e.impulse[3 * i + a];
    }
  }
  contact::FactoredOptions options;
  options.max_dissipation = is_max_dissipation(o.law);
  options.tolerance_absolute = 0.1 * tolerance, options.tolerance_relative = 0;
  options.residual_tolerance = 0.5 * tolerance;
  // Maximum dissipation has no Newton finish; its cap is a hundred times the option's.
  options.max_sweeps =
      options.max_dissipation ? std::max(1, o.max_sweeps / 100) : std::min(10, o.max_sweeps);
  const auto info = contact::solve_factored(p, options);
  r.sweeps += info.sweeps;
  r.newton_steps += info.newton_steps + info.fallback_steps;
  for (int i = 0; i < n; ++i)
    // An impulse on a contact that cannot push moves nothing; the Newton steps may leave a huge
    // one.
    for (int a = 0; a < 3; ++a)
      e.impulse[3 * i + a] = e.view.local[i].inv_zz > 0 ? p.impulse(i)[a] : 0;
}

/// Factored solve, then, where its factor is too coarse or it stalled, sweeps on G itself: plain,
/// then relaxed.
void run_auto(const contact::DenseFactor& f, const ContactProblem& problem, const SolveOptions& o,
              Explicit& e, Best& best, SolveResult& r) {
  const bool max_dissipation = is_max_dissipation(o.law);
  const auto finish_stage = [&] {
    best.offer(e, max_dissipation);
    if (o.record_history) r.history.push_back(best.residual);
    return best.residual <= o.tolerance;
  };
  if (f.rank > 0) {
    run_factored(f, problem, o, o.tolerance, e, r);
    if (finish_stage()) return;
  }
  contact::SweepOptions s = sweep_options(o);
  s.method = contact::Method::kHalley, s.stop = contact::StopTest::kResidual, s.gamma = 1,
  s.local_tolerance = 0;
  for (const double alpha : {1.0, 0.7}) {
    e.impulse = best.impulse.empty() ? e.impulse : best.impulse;
    e.view.lambda = e.impulse.data();
    refresh_velocity(e.view);
    s.alpha = alpha;
    run_sweeps(e, s, false, false, r);
    if (finish_stage()) return;
  }
}

/// A contact that cannot push but is driven into the ground.
bool infeasible(const ExplicitProblem& p, double tolerance) {
  for (int i = 0; i < p.n; ++i)
    if (!(p.local[i].inv_zz > 0) && p.v[3 * i + 2] < -tolerance) return true;
  return false;
}

}  // namespace

SolveResult solve(const ContactProblem& problem, const SolveOptions& options,
                  const std::vector<double>& warm_start) {
  options.validate();
  const contact::DenseFactor factor = contact::validated_factor(problem);
  const int n = problem.num_contacts();
  if (!warm_start.empty()) contact::check_impulse("the warm start", warm_start, n);
  const bool max_dissipation = is_max_dissipation(options.law);

  SolveResult r;
  Explicit e(problem, warm_start.empty() ? std::vector<double>(3 * n) : warm_start);
  Best best;
  // What costs nothing to try: the start itself. It is the answer only if nothing better comes.
  best.offer(e, max_dissipation);
  if (n > 0) {
    if (options.method == SolveMethod::kAuto)
      run_auto(factor, problem, options, e, best, r);
    else
      run_sweeps(e, sweep_options(options), options.method == SolveMethod::kPgs,
                 options.record_history, r);
    best.offer(e, max_dissipation);
  }
  // Everything reported is recomputed from the impulse that is returned.
  Explicit answer(problem, best.impulse.empty() ? std::vector<double>(3 * n) : best.impulse);
  r.contact_residuals.resize(n);
  for (int i = 0; i < n; ++i) {
    r.contact_residuals[i] = contact_residual(answer.view, i, max_dissipation);
    r.residual = std::fmax(r.residual, r.contact_residuals[i]);
  }
  r.velocity.assign(answer.view.v, answer.view.v + 3 * n);
  if (r.residual <= options.tolerance)
    r.status = SolveStatus::kConverged;
  else if (infeasible(answer.view, options.tolerance))
    r.status = SolveStatus::kInfeasible;
  r.impulse = answer.impulse;
  return r;
}

std::vector<double> residual(const ContactProblem& problem, const std::vector<double>& impulse,
                             FrictionLaw law) {
  problem.validate();
  contact::check_impulse("the impulse", impulse, problem.num_contacts());
  Explicit e(problem, impulse);
  std::vector<double> out(problem.num_contacts());
  for (int i = 0; i < e.view.n; ++i) out[i] = contact_residual(e.view, i, is_max_dissipation(law));
  return out;
}

SingleContactResult solve_contact(const double delassus[9], const double free_velocity[3],
                                  double friction, const SingleContactOptions& options) {
  const ContactProblem problem{
      {delassus, delassus + 9}, {free_velocity, free_velocity + 3}, {friction}};
  problem.validate();
  contact::check_single(options.method, options.law, "solve_contact");
  if (!(options.tolerance > 0)) throw ModelError("solve_contact: the tolerance must be positive");
  Explicit e(problem, std::vector<double>(3));
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
