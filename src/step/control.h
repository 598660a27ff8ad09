// Drives of the joints, forces of the user, and how a velocity moves a configuration.
#pragma once
#include "dynamics/link.h"
#include "lane/math.h"
#include "step/robot_lanes.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

/// Brings a quaternion to unit length: by a Newton step where it nearly is, as after a rotation.
/// Not finite where its square overflows or is zero.
template <class S>
STICKSLIP_INLINE void normalize(S quaternion[4]) {
  const S zero = constant<S>(0), one = constant<S>(1);
  S square = zero;
  for (int k = 0; k < 4; ++k) square = madd(quaternion[k], quaternion[k], square);
  S inverse = madd(constant<S>(-0.5), square, constant<S>(1.5));
  const auto far = !(abs(square - one) < constant<S>(sizeof(Value<S>) == 4 ? 1e-4 : 1e-8));
  if (any(far)) inverse = select(far, madd(zero, square, one / sqrt(square)), inverse);
  for (int k = 0; k < 4; ++k) quaternion[k] = quaternion[k] * inverse;
}

/// to = q (+) h v: positions and joints add, the base quaternion turns by the exponential map. A
/// zero is +0, whichever way it came about.
template <class S>
void integrate_configuration(const RobotTables& t, const S* q, const S* v, S h, S* to) {
  const S zero = constant<S>(0);
  const int joints = t.num_joints;
  if (!t.floating) {
    for (int j = 0; j < joints; ++j) to[j] = madd(h, v[j], q[j]) + zero;
    return;
  }
  for (int k = 0; k < 3; ++k) to[k] = madd(h, v[k], q[k]) + zero;
  for (int j = 0; j < joints; ++j) to[7 + j] = madd(h, v[6 + j], q[7 + j]) + zero;
  // exp(h w / 2) q
  const S half = constant<S>(0.5) * h;
  const Vec3<S> r{half * v[3], half * v[4], half * v[5]};
  S c, sinc;
  cos_and_sinc(dot(r, r), c, sinc);
  const Vec3<S> e = r * sinc;
  const S* p = q + 3;
  const S w = p[0], x = p[1], y = p[2], z = p[3];
  S n[4] = {c * w - e.x * x - e.y * y - e.z * z, c * x + e.x * w + e.y * z - e.z * y,
            c * y + e.y * w + e.z * x - e.x * z, c * z + e.z * w + e.x * y - e.y * x};
  normalize(n);
  for (int k = 0; k < 4; ++k) to[3 + k] = n[k] + zero;
}

/// Joint-space diagonal that makes damping and PD control implicit over h: h damping + h^2 kp,
/// docs/theory/step.md (S2). Null if there is none.
template <class S>
const S* implicit_diagonal(RobotLanes<S>& robot, S h) {
  const RobotTables& t = *robot.tables;
  if (!robot.control.pd && !t.damped) return nullptr;
  for (int j = 0; j < t.num_joints; ++j)
    robot.implicit[j] = h * (robot.control.damping[j] + h * robot.control.kp[j]);
  return robot.implicit;
}

/// Generalized force of control over a step h at velocity u: user's force, PD (target - q - h u),
/// damping, into robot.force; wrenches as forces on the links. False if no lane has any.
template <class S>
bool control_force(RobotLanes<S>& robot, const S* q, const S* u, S h) {
  const RobotTables& t = *robot.tables;
  const LaneControl<S>& c = robot.control;
  if (!c.pd && !c.force && !t.damped) return false;
  const int offset = robot.offset();
  for (int k = 0; k < offset; ++k) robot.force[k] = c.generalized_force[k];
  const S* joints = robot.joints(q);
  for (int j = 0; j < t.num_joints; ++j) {
    const S rate = u[offset + j];
    robot.force[offset + j] = c.generalized_force[offset + j] +
                              c.kp[j] * (c.target[j] - joints[j] - h * rate) - c.damping[j] * rate;
  }
  return true;
}

/// The part of robot.force that acts on the base.
template <class S>
Spatial<S> base_control(const RobotLanes<S>& robot) {
  if (!robot.tables->floating) return zero_spatial<S>();
  const S* f = robot.force;
  return {{f[3], f[4], f[5]}, {f[0], f[1], f[2]}};
}

/// What drives and wrenches do to base and links, as the forces of the tree.
template <class S>
void set_forces(RobotLanes<S>& robot) {
  dynamics::Tree<S>& t = *robot.tree;
  const auto* wrenches = robot.control.wrenches;
  t.base.force = base_control(robot);
  if (wrenches)
    t.base.force =
        t.base.force + dynamics::force_of_wrench(*robot.control.base_wrench, t.base.inertia);
  for (int slot = 0; slot < t.num_slots; ++slot)
    t.links[slot].force = wrenches
                              ? dynamics::force_of_wrench(wrenches[slot], t.links[slot].inertia)
                              : zero_spatial<dynamics::Wide<S>>();
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
