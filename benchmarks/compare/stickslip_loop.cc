#include "benchmarks/compare/stickslip_loop.h"

namespace stickslip::benchmarks {

World make_world(const Scenario& scenario, Integrator integrator) {
  WorldOptions options;
  options.time_step = kTimeStep;
  options.integrator = integrator;
  World world(options);
  if (scenario.ground) world.add_ground();
  world.add_robot(scenario.model).set_pd_gains(scenario.kp, scenario.kd);
  return world;
}

StickslipEngine::StickslipEngine(const Scenario& scenario, Integrator integrator)
    : scenario_(&scenario),
      world_(make_world(scenario, integrator)),
      robot_(&world_.robot(0)),
      q_(scenario.model->nq()),
      u_(scenario.model->nu()) {}

void StickslipEngine::reset(int episode) {
  scenario_->initial_state(episode, q_, u_);
  robot_->set_state(q_, u_);
}

void StickslipEngine::observe(Snapshot& out) const {
  out.q.assign(robot_->q().begin(), robot_->q().end());
  out.u.assign(robot_->u().begin(), robot_->u().end());
  out.contacts = robot_->info().contacts;
  out.pushing = 0;
  for (const Contact& c : robot_->contacts())
    out.pushing += c.impulse[2] > Snapshot::kLeastForce * kTimeStep;
  out.iterations = robot_->info().sweeps + robot_->info().newton_steps;
  out.residual = robot_->info().residual;
  const auto says = [&](StepStatus bit) {
    return (static_cast<unsigned>(robot_->info().status) & static_cast<unsigned>(bit)) != 0;
  };
  out.flagged = says(StepStatus::kNotConverged);
  out.failed = says(StepStatus::kNonFinite);
  out.energy = scenario_->shows_energy ? robot_->mechanical_energy() : 0;
}

}  // namespace stickslip::benchmarks
