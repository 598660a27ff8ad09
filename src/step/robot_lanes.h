// Everything a step works on: one robot per lane of S. A world has one lane and keeps it; a batch
// loads environments into the lanes of a pack and stores them again.
#pragma once
#include "contact/factored_problem.h"
#include "dynamics/tree.h"
#include "step/contact_stage.h"
#include "step/lane_arrays.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

/// What changes from step to step. Copying it is a snapshot; restoring it replays bit for bit.
template <class S>
struct LaneState {
  S *q, *u;
  S* impulse;  // per support point (3), of the last solve, over its step length [N]
  // Semi-implicit integrator only.
  S* earlier_impulse;  // the same of the solve before: the next may go on so
  // Energy-safe integrator only.
  S* drift_acceleration;  // -M^-1 C(q, u) at q: predictor of the next drift
  S pending_gravity;      // time of gravity not yet in u: half the last step while in contact [s]
  Mask<S> fresh;          // set from outside: the predictor of the first drift is still to be made
};

/// Forces and parameters, set by the user.
template <class S>
struct LaneControl {
  const S* generalized_force;     // (nu)
  const S *kp, *target;           // (joints)
  const S* damping;               // (joints) kd and the joint's own
  const S* friction;              // (shapes)
  const Spatial<S>* base_wrench;  // at the center of mass of body 0, world axes; null: none
  const Spatial<dynamics::Wide<S>>* wrenches;  // the same per slot
  Vec3<S> gravity;
  bool pd, force;         // any lane has gains, generalized forces or wrenches
  Mask<S> drives_joints;  // lanes with gains or forces on joints
  Mask<S> drives_base;    // lanes with a generalized force on the floating base
};

/// What the last step did, per lane. Copied number by number: a load over masks that were just
/// stored one by one waits until all stores before it are in the cache.
template <class S>
struct LaneInfo {
  Mask<S> unconverged;  // contact solve above its tolerance
  Mask<S> non_finite;   // the lane was left in its last finite state
  S residual;           // largest contact residual [m/s]
  int contacts = 0;     // in the last solve; of all lanes together, like what follows
  int sweeps = 0, newton_steps = 0;
  int substeps = 1;

  LaneInfo() = default;
  LaneInfo(const LaneInfo& other) { *this = other; }
  LaneInfo& operator=(const LaneInfo& other) {
    unconverged = other.unconverged;
    non_finite = other.non_finite;
    residual = other.residual;
    contacts = other.contacts;
    sweeps = other.sweeps;
    newton_steps = other.newton_steps;
    substeps = other.substeps;
    return *this;
  }
  void clear() {
    unconverged = non_finite = none<S>();
    residual = constant<S>(0);
    contacts = sweeps = newton_steps = 0;
    substeps = 1;
  }
};

/// Contacts of each lane's last substep, per support point. A lane that is through while others
/// take more substeps keeps its own.
template <class S>
struct LaneContacts {
  S* impulse = nullptr;  // (points, 3) [N s]
  Mask<S>* active = nullptr;
};

template <class S>
struct RobotLanes {
  const RobotTables* tables;
  dynamics::Tree<S>* tree;
  LaneState<S> state, backup;
  LaneControl<S> control;
  LaneInfo<S> info;
  ContactStage<S> contacts;
  LaneContacts<S> last_contacts;  // empty: not kept (a world's list is that of its only lane)
  // Workspace of the integrators.
  S *q_new, *q_moved, *u_free, *u_plus, *u_new, *rates, *implicit, *force, *delta,
      *gravity_acceleration, *start_impulse;
  Vec3<S> contact_origin;  // base position at the contacts of the last step
  // Energy-safe: kinematics and factor are those of state.q for this step length; 0: none.
  S prepared_step;

  /// Lays the workspace out; the state's arrays belong to the owner. With an empty arena it only
  /// counts.
  void lay_out(contact::Arena& arena, const RobotTables& t) {
    tables = &t;
    contacts.lay_out(arena, t);
    q_new = arena.take<S>(t.nq);
    q_moved = arena.take<S>(t.nq);
    S** const per_dof[] = {&u_free, &u_plus, &u_new, &rates, &force, &delta, &gravity_acceleration};
    for (S** array : per_dof) *array = arena.take<S>(t.nu);
    implicit = arena.take<S>(t.num_joints);
    start_impulse = arena.take<S>(3 * t.num_points);
    backup.q = arena.take<S>(t.nq);
    backup.u = arena.take<S>(t.nu);
    backup.impulse = arena.take<S>(3 * t.num_points);
    backup.drift_acceleration = arena.take<S>(t.nu);
  }

  int offset() const { return tables->floating ? 6 : 0; }  // of the joints in u
  const S* joints(const S* q) const { return tables->floating ? q + 7 : q; }
  Vec3<S> base_position(const S* q) const {
    return tables->floating ? Vec3<S>{q[0], q[1], q[2]}
                            : collide::constant3<S>(tables->fixed_position);
  }
  Vec3<S> linear(const S* u) const {
    return tables->floating ? Vec3<S>{u[0], u[1], u[2]} : zero3<S>();
  }
  Vec3<S> angular(const S* u) const {
    return tables->floating ? Vec3<S>{u[3], u[4], u[5]} : zero3<S>();
  }
  /// Positions of all links at q.
  void compute_positions(const S* q) {
    S fixed[4];
    for (int k = 0; k < 4; ++k) fixed[k] = constant<S>(tables->fixed_quaternion[k]);
    dynamics::compute_positions(*tree, tables->floating ? q + 3 : fixed, joints(q));
  }
};

/// `to` becomes a copy of `from`, whatever it held; not of the earlier impulses, which the
/// integrator that copies leaves alone.
template <class S>
STICKSLIP_INLINE void copy_state(const RobotTables& t, const LaneState<S>& from, LaneState<S>& to) {
  copy(from.q, t.nq, to.q);
  copy(from.u, t.nu, to.u);
  copy(from.impulse, 3 * t.num_points, to.impulse);
  copy(from.drift_acceleration, t.nu, to.drift_acceleration);
  to.pending_gravity = from.pending_gravity;
  to.fresh = from.fresh;
}
/// The state of the lanes `m` becomes that of `from`.
template <class S>
STICKSLIP_INLINE void copy_state_where(const RobotTables& t, Mask<S> m, const LaneState<S>& from,
                                       LaneState<S>& to) {
  copy_where(m, from.q, t.nq, to.q);
  copy_where(m, from.u, t.nu, to.u);
  copy_where(m, from.impulse, 3 * t.num_points, to.impulse);
  copy_where(m, from.drift_acceleration, t.nu, to.drift_acceleration);
  to.pending_gravity = select(m, from.pending_gravity, to.pending_gravity);
  to.fresh = (m & from.fresh) | ((!m) & to.fresh);
}

/// Notes the contacts of the list, or with `cleared` none, for these lanes.
template <class S>
void record_contacts(RobotLanes<S>& robot, Mask<S> lanes, bool cleared = false) {
  const LaneContacts<S>& last = robot.last_contacts;
  if (!last.impulse) return;
  clear_where(lanes, 3 * robot.tables->num_points, last.impulse);
  for (int k = 0; k < robot.tables->num_points; ++k) last.active[k] = last.active[k] & !lanes;
  for (int i = 0; i < robot.contacts.count() && !cleared; ++i) {
    const ActiveContact<S>& a = robot.contacts.active(i);
    const Mask<S> here = lanes & a.active;
    last.active[a.id] = last.active[a.id] | here;
    for (int r = 0; r < 3; ++r) {
      S& impulse = last.impulse[3 * a.id + r];
      impulse = select(here, robot.contacts.impulse(i)[r], impulse);
    }
  }
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
