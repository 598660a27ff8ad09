#include "step/robot_data.h"

#include "lane/math.h"

namespace stickslip::step {

RobotData::RobotData(ModelPtr m, const RobotOptions& options)
    : model(m),
      name(options.name.empty() ? m->name() : options.name),
      material(options.material),
      memory(*m),
      contacts(*m, memory.layout(), memory.max_depth()) {
  const int nq = m->nq(), nu = m->nu(), joints = m->num_joints();
  state.q.assign(nq, 0);
  state.u.assign(nu, 0);
  state.impulse.assign(3 * contacts.num_points(), 0);
  state.drift_acceleration.assign(nu, 0);
  const auto& o = options.orientation;
  fixed_position = {options.position[0], options.position[1], options.position[2]};
  for (int k = 0; k < 4; ++k) fixed_quaternion[k] = o[k];
  if (floating()) {
    for (int k = 0; k < 3; ++k) state.q[k] = options.position[k];
    for (int k = 0; k < 4; ++k) state.q[3 + k] = o[k];
  }
  control.generalized_force.assign(nu, 0);
  control.kp.assign(joints, 0);
  control.kd.assign(joints, 0);
  control.target.assign(joints, 0);
  for (const Joint& j : m->joints()) {
    damping.push_back(j.damping);
    damped = damped || j.damping > 0;
  }
  backup = state;  // sized here: a step allocates nothing
  q_new.resize(nq);
  implicit.resize(joints);
  for (auto* v : {&u_free, &u_plus, &rates, &force, &delta, &gravity_acceleration})
    v->assign(nu, 0);
}

void integrate_configuration(const RobotData& robot, double* q, const double* v, double h) {
  const int joints = robot.num_joints();
  if (!robot.floating()) {
    for (int j = 0; j < joints; ++j) q[j] = madd(h, v[j], q[j]);
    return;
  }
  for (int k = 0; k < 3; ++k) q[k] = madd(h, v[k], q[k]);
  for (int j = 0; j < joints; ++j) q[7 + j] = madd(h, v[6 + j], q[7 + j]);
  // exp(h w / 2) q, with sin(t)/t from its series where the division would lose digits.
  const double half = 0.5 * h;
  const Vec3<double> r{half * v[3], half * v[4], half * v[5]};
  const double t2 = dot(r, r), t = sqrt(t2);
  double s, c;
  sincos(t, s, c);
  const double sinc = t > 1e-4 ? s / t : 1 - t2 / 6;
  const Vec3<double> e = r * sinc;
  double* p = q + 3;
  const double w = p[0], x = p[1], y = p[2], z = p[3];
  const double n[4] = {c * w - e.x * x - e.y * y - e.z * z, c * x + e.x * w + e.y * z - e.z * y,
                       c * y + e.y * w + e.z * x - e.x * z, c * z + e.z * w + e.x * y - e.y * x};
  const double inv = 1 / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + n[3] * n[3]);
  for (int k = 0; k < 4; ++k) p[k] = n[k] * inv;
}

const double* implicit_diagonal(RobotData& robot, double h) {
  if (!robot.control.pd && !robot.damped) return nullptr;
  for (int j = 0; j < robot.num_joints(); ++j)
    robot.implicit[j] = h * (robot.control.kd[j] + robot.damping[j] + h * robot.control.kp[j]);
  return robot.implicit.data();
}

bool control_force(RobotData& robot, const double* q, const double* u, double h, double* out) {
  const RobotControl& c = robot.control;
  if (!c.pd && !c.force && !robot.damped) return false;
  const int offset = robot.offset();
  for (int k = 0; k < offset; ++k) out[k] = c.generalized_force[k];
  const double* joints = robot.joints(q);
  for (int j = 0; j < robot.num_joints(); ++j) {
    const double rate = u[offset + j];
    out[offset + j] = c.generalized_force[offset + j] +
                      c.kp[j] * (c.target[j] - joints[j] - h * rate) -
                      (c.kd[j] + robot.damping[j]) * rate;
  }
  return true;
}

}  // namespace stickslip::step
