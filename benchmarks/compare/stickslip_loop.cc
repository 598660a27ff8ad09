#include "benchmarks/compare/stickslip_loop.h"

namespace stickslip::benchmarks {

StickslipEngine::StickslipEngine(const Scenario& scenario, Integrator integrator)
    : scenario_(&scenario), q_(scenario.model->nq()), u_(scenario.model->nu()) {
  WorldOptions options;
  options.time_step = kTimeStep;
  options.integrator = integrator;
  world_ = std::make_unique<World>(options);
  if (scenario.ground) world_->add_ground();
  robot_ = &world_->add_robot(scenario.model);
  robot_->set_pd_gains(scenario.kp, scenario.kd);
}

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
  out.failed = robot_->info().status != StepStatus::kOk;
  out.energy = scenario_->shows_energy ? robot_->mechanical_energy() : 0;
}

}  // namespace stickslip::benchmarks
