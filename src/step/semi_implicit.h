// The paper's step, [Hwangbo 2018] section II: semi-implicit Euler, contact at velocity level, no
// position correction.
//
//   M (u+ - u) = dt (tau - h) + J^T lambda,   q+ = q (+) dt u+
// Where we differ: damping and PD control are implicit in the rates; M is never inverted nor
// formed (docs/theory/step.md (S1), (S2)).
#pragma once
#include "dynamics/dynamics.h"
#include "step/control.h"
#include "step/stage_timer.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

/// Kinematics, bias and factor at q, and x = L^-T dt (tau - h), the free velocity change in
/// L-space.
template <class S>
STICKSLIP_INLINE void compute_free_motion(RobotLanes<S>& robot, double time_step) {
  const S dt = constant<S>(time_step);
  const RobotTables& tables = *robot.tables;
  const S *q = robot.state.q, *u = robot.state.u;
  dynamics::Tree<S>& t = *robot.tree;
  dynamics::WalkInput<S> in;
  S fixed[4];
  for (int k = 0; k < 4; ++k) fixed[k] = constant<S>(tables.fixed_quaternion[k]);
  in.quaternion = tables.floating ? q + 3 : fixed;
  in.joints = robot.joints(q);
  in.angular_velocity = robot.angular(u);
  in.rates = u + robot.offset();
  in.gravity = robot.control.gravity;
  in.diagonal = implicit_diagonal(robot, dt);
  const bool driven = control_force(robot, q, u, dt);
  const Spatial<S> on_base = driven ? base_control(robot) : zero_spatial<S>();
  in.tau = driven ? robot.force + robot.offset() : nullptr;
  in.base_force = driven ? &on_base : nullptr;
  in.base_wrench = robot.control.base_wrench;
  in.wrenches = robot.control.wrenches;
  in.scale = time_step;
  dynamics::compute_free_motion(t, in);
}

/// One time step. The state of a lane only changes if its result is finite. May exchange arrays of
/// the state with each other and with the workspace.
template <class S>
void step_semi_implicit(RobotLanes<S>& robot, const StepSettings& settings) {
  StageTimer timer(settings);
  const RobotTables& tables = *robot.tables;
  dynamics::Tree<S>& t = *robot.tree;
  LaneState<S>& s = robot.state;
  const S zero = constant<S>(0), dt = constant<S>(settings.time_step);
  const int offset = robot.offset(), nq = tables.nq, nu = tables.nu;
  robot.info.clear();

  compute_free_motion(robot, settings.time_step);
  timer.end(kDynamics);

  // Contacts: overlapping points only.
  ContactStage<S>& contacts = robot.contacts;
  const Mask<S> everywhere = !none<S>();
  contacts.forget();
  robot.contact_origin = robot.base_position(s.q);
  if (settings.ground)
    contacts.detect_overlapping(t, robot.contact_origin.z - constant<S>(settings.ground_height),
                                everywhere);
  contacts.compute_velocities(t, robot.linear(s.u));
  contacts.add_restitution(zero, dt);
  timer.end(kDetection);
  if (contacts.count() > 0) {
    contacts.build_problem(t, robot.control.friction, true);
    timer.end(kDelassus);
    // The methods of the paper start at the last impulses.
    contacts.start_at(settings.warm_start ? s.impulse : nullptr,
                      settings.host.always ? nullptr : s.earlier_impulse, dt);
    contacts.solve(settings, everywhere, robot.info);
    contacts.add_impulses(t, everywhere);
    timer.end(kSolve);
  }
  record_contacts(robot, everywhere);

  // u+ = u + L^-1 (x + Y^T lambda), q+ = q (+) dt u+. A zero is +0, whichever way it came about.
  S base[6], *next = robot.u_plus, *q_new = robot.q_new;
  dynamics::solve_lower(t, base, next + offset);
  for (int k = 0; k < offset; ++k) next[k] = s.u[k] + base[k] + zero;
  for (int j = offset; j < nu; ++j) next[j] = s.u[j] + next[j] + zero;
  integrate_configuration(tables, s.q, next, dt, q_new);
  const Mask<S> finite = are_finite(q_new, nq) & are_finite(next, nu);
  if (all(finite)) {
    swap(s.q, robot.q_new);
    swap(s.u, robot.u_plus);
  } else {
    copy_where(finite, q_new, nq, s.q);
    copy_where(finite, next, nu, s.u);
    swap_where(!finite, 3 * tables.num_points, s.impulse, s.earlier_impulse);
    contacts.forget(!finite);
    record_contacts(robot, !finite, true);
    robot.info.non_finite = !finite;
    robot.info.unconverged = robot.info.unconverged & finite;
    robot.info.residual = select(finite, robot.info.residual, zero);
  }
  contacts.write_forces(finite, dt, s.earlier_impulse);
  swap(s.impulse, s.earlier_impulse);
  timer.end(kIntegrate);
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
