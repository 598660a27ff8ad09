// The paper's step, [Hwangbo 2018] section II: semi-implicit Euler, contact at velocity level, no
// position correction.
//
//   M (u+ - u) = dt (tau - h) + J^T lambda,   q+ = q (+) dt u+
// Where we differ: damping and PD control are implicit in the rates; M is never inverted nor
// formed (docs/theory/step.md (S1), (S2)).
#include <algorithm>
#include <cmath>

#include "step/robot_data.h"
#include "step/stage_timer.h"

namespace stickslip::step {
namespace {

/// x <- dt x for all of L-space.
void scale_x(dynamics::Tree<double>& t, double dt) {
  for (int k = 0; k < 6; ++k) t.base.x[k] *= dt;
  for (int slot = 0; slot < t.num_slots; ++slot) t.links[slot].x *= Pack<double, 4>(dt);
}

}  // namespace

void step_semi_implicit(RobotData& robot, const StepContext& context) {
  StageTimer timer(context.times);
  dynamics::Tree<double>& t = robot.tree();
  RobotState& s = robot.state;
  const double dt = context.time_step, *q = s.q.data(), *u = s.u.data();
  const int offset = robot.offset(), joints = robot.num_joints();
  robot.info = StepInfo{};
  robot.backup.impulse = s.impulse;

  // Kinematics, bias and factor; x = L^-T dt (tau - h), the free velocity change in L-space.
  dynamics::compute_positions(t, robot.base_quaternion(q), robot.joints(q));
  dynamics::compute_inertias(t);
  dynamics::factor_mass_matrix(t, implicit_diagonal(robot, dt));
  dynamics::compute_bias(t, robot.angular(u), u + offset, context.gravity);
  double* tau = robot.force.data();
  const bool driven = control_force(robot, q, u, dt, tau);
  if (driven && offset)
    t.base.force =
        t.base.force + Spatial<double>{{tau[3], tau[4], tau[5]}, {tau[0], tau[1], tau[2]}};
  dynamics::solve_lower_transposed(t, driven ? tau + offset : nullptr, dynamics::LinkForces::kAll);
  scale_x(t, dt);
  timer.end(&StageTimes::dynamics);

  // Contacts: overlapping points only.
  ContactStage& contacts = robot.contacts;
  contacts.forget();
  robot.contact_origin = robot.base_position(q);
  if (context.ground)
    contacts.detect_overlapping(t, robot.base_position(q).z - context.ground_height);
  contacts.compute_velocities(t, robot.linear(u));
  contacts.add_restitution(0, dt);
  timer.end(&StageTimes::detection);
  if (contacts.count() > 0) {
    contacts.build_problem(t, true);
    timer.end(&StageTimes::delassus);
    contacts.solve(*context.solver, s.impulse.data(), dt, robot.info);
    contacts.add_impulses(t);
    timer.end(&StageTimes::solve);
  } else {
    std::fill(s.impulse.begin(), s.impulse.end(), 0.0);
  }

  // u+ = u + L^-1 (x + Y^T lambda), q+ = q (+) dt u+.
  double base[6], *next = robot.u_plus.data(), sum = 0;
  dynamics::solve_lower(t, base, next + offset);
  for (int k = 0; k < offset; ++k) next[k] = u[k] + base[k];
  for (int j = offset; j < offset + joints; ++j) next[j] += u[j];
  for (int k = 0; k < offset + joints; ++k) sum += std::fabs(next[k]);
  robot.q_new = s.q;
  integrate_configuration(robot, robot.q_new.data(), next, dt);
  for (const double x : robot.q_new) sum += std::fabs(x);
  if (!std::isfinite(sum)) {
    s.impulse = robot.backup.impulse;
    robot.contacts.forget();
    robot.info.status = StepStatus::kNonFinite;
    return;
  }
  s.q = robot.q_new;
  std::copy(next, next + offset + joints, s.u.begin());
  s.time += dt;
  timer.end(&StageTimes::integrate);
}

}  // namespace stickslip::step
