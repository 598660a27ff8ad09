#include "world/host_solver.h"

#include <algorithm>
#include <chrono>

#include "contact/explicit_problem.h"
#include "contact/per_contact.h"
#include "contact/pgs.h"
#include "solvers/chain.h"
#include "solvers/method_of.h"

namespace stickslip::world {
namespace {

/// Of the explicit view of a problem and, for the chain, its best impulse and its stages.
size_t bytes(int contacts, bool chain) {
  const size_t numbers = contact::ExplicitProblem::workspace_size(contacts);
  const size_t best = chain ? 3 * size_t(contacts) : 0;
  return sizeof(double) * (numbers + best) + (chain ? solvers::brief_chain_bytes(contacts) : 0);
}

contact::ExplicitProblem view_of(const step::DenseProblem& d, double* workspace) {
  contact::ExplicitProblem p{d.contacts, d.delassus, d.free_velocity, d.friction, d.impulse};
  p.attach(workspace);
  contact::prepare(p);
  return p;
}

void take_velocity(const contact::ExplicitProblem& p, step::DenseProblem& d) {
  std::copy(p.v, p.v + 3 * d.contacts, d.velocity);
}

}  // namespace

SolverOnHost::SolverOnHost(int max_points, const StepSolverOptions& options)
    : options_(options),
      max_contacts_(options.method == SolveMethod::kAuto
                        ? std::min(max_points, solvers::kRobotSized)
                        : max_points),
      memory_(bytes(max_contacts_, options.method == SolveMethod::kAuto)) {}

step::HostSolver SolverOnHost::view() {
  const bool automatic = options_.method == SolveMethod::kAuto;
  return {this, automatic ? run_chain : run_method, !automatic, max_contacts_};
}

step::HostSolver::Effort SolverOnHost::run_method(void* self, step::DenseProblem& d, double) {
  const auto& solver = *static_cast<SolverOnHost*>(self);
  const StepSolverOptions& options = solver.options_;
  contact::ExplicitProblem p = view_of(d, reinterpret_cast<double*>(solver.memory_.data()));
  contact::SweepOptions o;
  o.max_dissipation = options.law == FrictionLaw::kMaxDissipation;
  o.method = solvers::method_of(options.single_contact);
  o.stop = options.method == SolveMethod::kPgs ? contact::StopTest::kUpdateSum
                                               : contact::StopTest::kViolationSum;
  o.tolerance = options.tolerance;
  o.max_sweeps = options.max_sweeps;
  o.alpha = options.alpha, o.alpha_min = options.alpha_min, o.gamma = options.gamma;
  const contact::SweepResult found =
      options.method == SolveMethod::kPgs ? contact::pgs(p, o) : contact::per_contact(p, o);
  contact::refresh_velocity(p);
  take_velocity(p, d);
  step::HostSolver::Effort effort;
  effort.sweeps = found.sweeps;
  effort.solved = found.converged;
  effort.residual = contact::largest_residual(p, o.max_dissipation);
  return effort;
}

step::HostSolver::Effort SolverOnHost::run_chain(void* self, step::DenseProblem& d,
                                                 double tolerance) {
  const auto& solver = *static_cast<SolverOnHost*>(self);
  std::pmr::monotonic_buffer_resource memory(solver.memory_.data(), bytes(d.contacts, true));
  solvers::Doubles workspace(contact::ExplicitProblem::workspace_size(d.contacts), &memory);
  contact::ExplicitProblem p = view_of(d, workspace.data());
  solvers::BestImpulse best(tolerance, false, nullptr, &memory);
  solvers::Effort spent;
  if (!best.offer(p, SolveStage::kStart)) solvers::run_brief_chain(p, best, spent, &memory);
  best.restore(p);
  take_velocity(p, d);
  step::HostSolver::Effort effort;
  effort.newton_steps = spent.newton_steps + spent.interior_point_steps;
  // Contacts that cannot push count here: a step may not hide that one is driven in.
  effort.residual = contact::largest_residual(p, false);
  effort.solved = effort.residual <= tolerance;
  return effort;
}

double clock_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

step::StepSettings step_settings(const WorldOptions& o) {
  step::StepSettings s{};
  s.time_step = o.time_step;
  s.max_substeps = o.max_substeps;
  s.energy_safe = o.integrator == Integrator::kEnergySafe;
  s.max_dissipation = o.solver.law == FrictionLaw::kMaxDissipation;
  s.warm_start = o.solver.warm_start;
  s.tolerance = o.solver.tolerance;
  s.relative_tolerance = o.solver.relative_tolerance;
  return s;
}

}  // namespace stickslip::world
