#include "world/robot_data.h"

#include <algorithm>

#include "step/integrators.h"

namespace stickslip::world {
namespace {

/// Lays the lanes out in a block of their own.
AlignedBlock give_memory(step::RobotLanes<double>& lanes, const step::RobotTables& tables) {
  contact::Arena count(nullptr);
  lanes.lay_out(count, tables);
  AlignedBlock block(static_cast<size_t>(count.used()));
  contact::Arena arena(block.data());
  lanes.lay_out(arena, tables);
  return block;
}

/// An array of the state that a step may have exchanged with its workspace.
void take_back(double*& held, double*& workspace, std::vector<double>& mine) {
  if (held == mine.data()) return;
  std::copy_n(held, mine.size(), mine.data());
  workspace = held;
  held = mine.data();
}

}  // namespace

RobotData::RobotData(ModelPtr m, const RobotOptions& o, const StepSolverOptions& solver)
    : model(m),
      name(o.name.empty() ? m->name() : o.name),
      material(o.material),
      options(o),
      memory(*m),
      scene(*m, memory.layout(), o),
      host(scene.tables().num_points, solver),
      block_(give_memory(lanes, scene.tables())) {
  const int nu = m->nu(), joints = m->num_joints();
  state.q.assign(m->nq(), 0);
  state.u.assign(nu, 0);
  state.impulse.assign(3 * scene.tables().num_points, 0);
  state.earlier_impulse.assign(3 * scene.tables().num_points, 0);
  state.drift_acceleration.assign(nu, 0);
  if (floating()) {
    std::copy(o.position.begin(), o.position.end(), state.q.begin());
    std::copy(o.orientation.begin(), o.orientation.end(), state.q.begin() + 3);
  }
  control.generalized_force.assign(nu, 0);
  control.kp.assign(joints, 0);
  control.kd.assign(joints, 0);
  control.target.assign(joints, 0);
  control.damping.assign(scene.tables().damping, scene.tables().damping + joints);
  lanes.tree = &memory.tree();
  lanes.contact_origin = zero3<double>();
  lanes.prepared_step = 0;
}

void RobotData::forget_step() {
  lanes.prepared_step = 0;
  lanes.contacts.forget();
}

void RobotData::step(step::StepSettings settings, const Vec3<double>& gravity) {
  step::LaneState<double>& s = lanes.state;
  s = {state.q.data(),
       state.u.data(),
       state.impulse.data(),
       state.earlier_impulse.data(),
       state.drift_acceleration.data(),
       state.pending_gravity,
       state.fresh};
  const RobotControl& c = control;
  const bool on_base = c.force && floating() &&
                       std::any_of(c.generalized_force.begin(), c.generalized_force.begin() + 6,
                                   [](double x) { return x != 0; });
  lanes.control = {c.generalized_force.data(),
                   c.kp.data(),
                   c.target.data(),
                   c.damping.data(),
                   scene.friction().data(),
                   nullptr,
                   nullptr,
                   gravity,
                   c.pd,
                   c.force,
                   c.pd || c.force,
                   on_base};
  settings.host = host.view();
  if (settings.energy_safe)
    step::step_energy_safe(lanes, settings);
  else
    step::step_semi_implicit(lanes, settings);
  take_back(s.q, lanes.q_new, state.q);
  take_back(s.u, lanes.u_plus, state.u);
  if (s.impulse != state.impulse.data()) state.impulse.swap(state.earlier_impulse);
  state.pending_gravity = s.pending_gravity;
  state.fresh = s.fresh;
  const step::LaneInfo<double>& i = lanes.info;
  info = {StepStatus::kOk, i.contacts, i.sweeps, i.newton_steps, i.substeps, i.residual};
  if (i.unconverged) info.status = StepStatus::kNotConverged;
  if (i.non_finite)
    info.status = StepStatus::kNonFinite;
  else
    state.time += settings.time_step;
}

}  // namespace stickslip::world
