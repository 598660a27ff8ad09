// Environments of a batch into the lanes of a pack, and back.
#pragma once
#include "backend/cpu/pack_kernels.h"
#include "lane/transpose.h"
#include "step/robot_lanes.h"

namespace stickslip::backend::inline STICKSLIP_KERNELS {

/// A pack of environments: the robot that the step works on, and how it is loaded and stored.
template <class S>
class PackLanes {
 public:
  using T = Value<S>;
  static constexpr int kWidth = ScalarTraits<S>::kWidth;

  /// With an empty arena it only counts.
  void lay_out(contact::Arena& arena, const PackScene& scene);
  step::RobotLanes<S>& robot() { return robot_; }

  /// Takes the environments at places first .. first + width - 1. A state that was written since
  /// the last step starts afresh; one that is not a state (NaN, no unit quaternion) is set aside.
  /// Lanes beyond num_envs repeat the last one before.
  void load(const EnvArrays& arrays, long first, long num_envs);
  void use_inertias(const PackInertias& inertias);
  /// Before each step of the robot: whether `store` will ask for its contacts.
  void keep_contacts(bool keep) {
    robot_.last_contacts = keep ? contacts_ : step::LaneContacts<S>{};
  }
  /// After each step of the robot.
  void count_step();
  /// Status bits of the environments below num_envs, or-ed.
  StatusBits store(const EnvArrays& arrays, const step::StepSettings& settings, long first,
                   long num_envs);

 private:
  void lay_out_tree(contact::Arena& arena, const PackScene& scene);
  void load_control(const EnvArrays& arrays);
  void load_parameter(const Parameter& p, int n, S* out);
  void load_wrenches(const EnvArrays& arrays);
  void check_state();
  /// Lanes without an environment become copies of the last one that has one.
  void repeat(S* values, int n) const {
    for (int lane = used_; lane < kWidth; ++lane)
      for (int k = 0; k < n; ++k) set_lane(values[k], lane, get_lane(values[k], used_ - 1));
  }
  void load_field(const void* data, int n, S* out) const {
    load_rows(static_cast<const T*>(data), envs_, n, out);
  }
  void store_field(const S* in, int n, void* data) const {
    store_rows(in, n, static_cast<T*>(data), envs_);
  }
  S* history(const EnvArrays& arrays, long first, int row) const {
    const PackHistory h(*scene_.tables);
    return static_cast<S*>(arrays.history) + first / kWidth * h.numbers + row;
  }

  PackScene scene_;
  dynamics::Tree<S> tree_;
  step::RobotLanes<S> robot_;
  S *force_, *kp_, *damping_, *target_, *friction_, *gravity_;
  S *last_q_, *last_u_, *scratch_;
  Spatial<dynamics::Wide<S>>* wrenches_;
  Spatial<S> base_wrench_;
  step::LaneContacts<S> contacts_;
  Mask<S> set_aside_, fresh_, unconverged_, non_finite_;
  S residual_, steps_failed_;
  long steps_ = 0;
  const int* envs_;    // of the lanes
  int used_ = kWidth;  // lanes with an environment
};

template <class S>
void PackLanes<S>::lay_out(contact::Arena& arena, const PackScene& scene) {
  scene_ = scene;
  const step::RobotTables& t = *scene.tables;
  lay_out_tree(arena, scene);
  robot_.tree = &tree_;
  robot_.lay_out(arena, t);
  step::LaneState<S>& s = robot_.state;
  s.q = arena.take<S>(t.nq);
  s.u = arena.take<S>(t.nu);
  s.impulse = arena.take<S>(3 * t.num_points);
  s.earlier_impulse = arena.take<S>(3 * t.num_points);
  s.drift_acceleration = arena.take<S>(t.nu);
  force_ = arena.take<S>(t.nu);
  kp_ = arena.take<S>(t.num_joints);
  damping_ = arena.take<S>(t.num_joints);
  target_ = arena.take<S>(t.num_joints);
  friction_ = arena.take<S>(t.num_shapes);
  gravity_ = arena.take<S>(3);
  last_q_ = arena.take<S>(t.nq);
  last_u_ = arena.take<S>(t.nu);
  wrenches_ = arena.take<Spatial<dynamics::Wide<S>>>(t.num_slots);
  scratch_ = arena.take<S>(6 * t.num_bodies);
  contacts_ = {arena.take<S>(3 * t.num_points), arena.take<Mask<S>>(t.num_points)};
  step::LaneControl<S>& c = robot_.control;
  c = {force_,  kp_,        target_, damping_, friction_, nullptr,
       nullptr, zero3<S>(), true,    false,    none<S>(), none<S>()};
}

template <class S>
void PackLanes<S>::lay_out_tree(contact::Arena& arena, const PackScene& scene) {
  tree_.floating = scene.tables->floating;
  tree_.num_bundles = scene.num_bundles;
  tree_.num_slots = scene.num_slots;
  tree_.num_joints = scene.num_joints;
  tree_.bundles = scene.bundles;
  tree_.slots = scene.slots;
  tree_.constants =
      static_cast<const dynamics::LinkConstants<dynamics::WideConstant<S>>*>(scene.constants);
  tree_.links = arena.take<dynamics::LinkState<dynamics::Wide<S>>>(scene.num_slots);
  use_inertias({});
}

template <class S>
void PackLanes<S>::load_parameter(const Parameter& p, int n, S* out) {
  if (p.per_env)
    load_field(p.data, n, out);
  else
    for (int k = 0; k < n; ++k) out[k] = S(static_cast<const T*>(p.data)[k]);
  repeat(out, n);
}

template <class S>
void PackLanes<S>::load(const EnvArrays& arrays, long first, long num_envs) {
  envs_ = arrays.order + first;
  used_ = first + kWidth <= num_envs ? kWidth : int(num_envs - first);
  const step::RobotTables& t = *scene_.tables;
  const PackHistory h(t);
  step::LaneState<S>& s = robot_.state;
  load_field(arrays.q, t.nq, s.q);
  load_field(arrays.u, t.nu, s.u);
  const S* past = history(arrays, first, 0);
  step::copy(past + h.q, t.nq, last_q_);
  step::copy(past + h.u, t.nu, last_u_);
  step::copy(past + h.impulse, 3 * t.num_points, s.impulse);
  step::copy(past + h.earlier, 3 * t.num_points, s.earlier_impulse);
  step::copy(past + h.drift, t.nu, s.drift_acceleration);
  s.pending_gravity = past[h.pending];
  S fresh = past[h.fresh];
  repeat(s.q, t.nq), repeat(s.u, t.nu), repeat(last_q_, t.nq), repeat(last_u_, t.nu);
  repeat(s.impulse, 3 * t.num_points), repeat(s.earlier_impulse, 3 * t.num_points);
  repeat(s.drift_acceleration, t.nu);
  repeat(&s.pending_gravity, 1), repeat(&fresh, 1);
  s.fresh = fresh > constant<S>(0.5);
  check_state();
  fresh_ = s.fresh;
  load_control(arrays);
  if (arrays.continues) {
    S aside = past[h.aside];
    repeat(&aside, 1);
    set_aside_ = set_aside_ | (aside > constant<S>(0.5));
  }
  robot_.prepared_step = constant<S>(0);
  robot_.contacts.forget();
  unconverged_ = non_finite_ = none<S>();
  residual_ = steps_failed_ = constant<S>(0);
  steps_ = 0;
}

/// Lanes whose state is not the one that the last step left start afresh, without warm start and
/// their quaternion brought to unit length, as `Robot::set_state` does; what is no state is
/// replaced by the last one.
template <class S>
void PackLanes<S>::check_state() {
  const step::RobotTables& t = *scene_.tables;
  step::LaneState<S>& s = robot_.state;
  const S zero = constant<S>(0), one = constant<S>(1), largest = constant<S>(step::kLargestJoint);
  Mask<S> same = !none<S>();
  for (int k = 0; k < t.nq; ++k) same = same & (s.q[k] >= last_q_[k]) & (s.q[k] <= last_q_[k]);
  for (int k = 0; k < t.nu; ++k) same = same & (s.u[k] >= last_u_[k]) & (s.u[k] <= last_u_[k]);
  set_aside_ = none<S>();
  if (all(same)) return;
  Mask<S> good = step::are_finite(s.q, t.nq) & step::are_finite(s.u, t.nu);
  const S* joints = robot_.joints(s.q);
  for (int j = 0; j < t.num_joints; ++j) good = good & (abs(joints[j]) <= largest);
  if (t.floating) {
    S* p = s.q + 3;
    const S norm = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
    good = good & (abs(norm - one) <= constant<S>(step::kQuaternionTolerance));
    for (int k = 0; k < 4; ++k) p[k] = select((!same) & good, p[k] / norm, p[k]);
  }
  set_aside_ = !(good | same);
  step::copy_where(set_aside_, last_q_, t.nq, s.q);
  step::copy_where(set_aside_, last_u_, t.nu, s.u);
  const Mask<S> fresh = good & !same;
  s.fresh = s.fresh | fresh;
  s.pending_gravity = select(fresh, zero, s.pending_gravity);
  step::clear_where(fresh, 3 * t.num_points, s.impulse);
  step::clear_where(fresh, 3 * t.num_points, s.earlier_impulse);
  step::copy_where(fresh, s.q, t.nq, last_q_);
  step::copy_where(fresh, s.u, t.nu, last_u_);
}

template <class S>
void PackLanes<S>::load_control(const EnvArrays& arrays) {
  const step::RobotTables& t = *scene_.tables;
  step::LaneControl<S>& c = robot_.control;
  const S zero = constant<S>(0);
  load_parameter(arrays.kp, t.num_joints, kp_);
  load_parameter(arrays.kd, t.num_joints, damping_);  // kd so far
  load_parameter(arrays.friction, t.num_shapes, friction_);
  load_parameter(arrays.gravity, 3, gravity_);
  // Whatever else is not finite shows in the velocities; a friction that is none would only open
  // the contacts.
  for (int k = 0; k < t.num_shapes; ++k) set_aside_ = set_aside_ | !(friction_[k] >= zero);
  load_field(arrays.pd_target, t.num_joints, target_);
  repeat(target_, t.num_joints);
  // Else a target that is none would count or not, by whether a neighbor is driven.
  for (int j = 0; j < t.num_joints; ++j) set_aside_ = set_aside_ | !step::is_finite(target_[j]);
  c.gravity = {gravity_[0], gravity_[1], gravity_[2]};
  const auto some = [&](S x) { return !((x >= zero) & (x <= zero)); };  // also NaN
  Mask<S> gains = none<S>(), forces = gains, on_base = gains, pushed = gains;
  for (int j = 0; j < t.num_joints; ++j) gains = gains | some(kp_[j]) | some(damping_[j]);
  if (t.damped)
    for (int j = 0; j < t.num_joints; ++j) damping_[j] = damping_[j] + constant<S>(t.damping[j]);
  if (arrays.force) {
    load_field(arrays.generalized_force, t.nu, force_);
    repeat(force_, t.nu);
    for (int k = 0; k < t.nu; ++k) forces = forces | some(force_[k]);
    for (int k = 0; k < robot_.offset(); ++k) on_base = on_base | some(force_[k]);
  } else {
    for (int k = 0; k < t.nu; ++k) force_[k] = zero;
  }
  load_wrenches(arrays);
  if (c.wrenches) {
    // What pulls at a fixed base moves nothing.
    for (int k = t.floating ? 0 : 6; k < 6 * t.num_bodies; ++k) pushed = pushed | some(scratch_[k]);
    for (int k = 0; k < 6 * t.num_bodies; ++k)
      set_aside_ = set_aside_ | !step::is_finite(scratch_[k]);
  }
  forces = forces | pushed;
  c.pd = any(gains);
  c.force = any(forces);
  c.drives_joints = gains | forces;
  c.drives_base = on_base | pushed;
}

template <class S>
void PackLanes<S>::use_inertias(const PackInertias& inertias) {
  tree_.inertias = static_cast<const dynamics::LinkInertia<dynamics::Wide<S>>*>(inertias.links);
  const auto* base = static_cast<const dynamics::LinkInertia<S>*>(inertias.base);
  tree_.base_mass = base ? base->mass : constant<S>(scene_.base_mass);
  for (int k = 0; k < 3; ++k)
    tree_.base_com[k] = base ? base->com[k] : constant<S>(scene_.base_com[k]);
  for (int k = 0; k < 6; ++k)
    tree_.base_inertia[k] = base ? base->inertia[k] : constant<S>(scene_.base_inertia[k]);
}

/// Wrenches (bodies, 6), force and torque, to the slots of the tree.
template <class S>
void PackLanes<S>::load_wrenches(const EnvArrays& arrays) {
  step::LaneControl<S>& c = robot_.control;
  c.base_wrench = nullptr, c.wrenches = nullptr;
  if (!arrays.external_wrench.data) return;
  const step::RobotTables& t = *scene_.tables;
  load_parameter(arrays.external_wrench, 6 * t.num_bodies, scratch_);
  for (int slot = 0; slot < t.num_slots; ++slot)
    wrenches_[slot] = zero_spatial<dynamics::Wide<S>>();
  for (int body = 0; body < t.num_bodies; ++body) {
    const S* w = scratch_ + 6 * body;
    const Spatial<S> wrench{{w[3], w[4], w[5]}, {w[0], w[1], w[2]}};
    const dynamics::LinkIndex link = t.body_links[body];
    if (link.slot == dynamics::kBaseSlot) {
      base_wrench_ = wrench;
      continue;
    }
    const auto* from = reinterpret_cast<const S*>(&wrench);
    auto* to = reinterpret_cast<dynamics::Wide<S>*>(&wrenches_[link.slot]);
    for (int k = 0; k < 6; ++k) dynamics::put_lane<S>(to[k], link.lane, from[k]);
  }
  c.base_wrench = &base_wrench_;
  c.wrenches = wrenches_;
}

template <class S>
void PackLanes<S>::count_step() {
  const step::LaneInfo<S>& i = robot_.info;
  unconverged_ = unconverged_ | i.unconverged;
  non_finite_ = non_finite_ | i.non_finite;
  residual_ = max(residual_, i.residual);
  if (any(i.non_finite))
    steps_failed_ = steps_failed_ + select(i.non_finite, constant<S>(1), constant<S>(0));
  ++steps_;
}

template <class S>
StatusBits PackLanes<S>::store(const EnvArrays& arrays, const step::StepSettings& settings,
                               long first, long num_envs) {
  const step::RobotTables& t = *scene_.tables;
  const PackHistory h(t);
  step::LaneState<S>& s = robot_.state;
  const S zero = constant<S>(0), one = constant<S>(1);
  // What was no state is left where it was last one.
  S* past = history(arrays, first, 0);
  if (any(set_aside_)) {
    step::copy_where(set_aside_, last_q_, t.nq, s.q);
    step::copy_where(set_aside_, last_u_, t.nu, s.u);
    const Mask<S> old = set_aside_ & !fresh_;
    const auto take_back = [&](int row, S* forces) {
      step::clear_where(set_aside_, 3 * t.num_points, forces);
      step::copy_where(old, past + row, 3 * t.num_points, forces);
    };
    take_back(h.impulse, s.impulse);
    take_back(h.earlier, s.earlier_impulse);
    step::copy_where(set_aside_, past + h.drift, t.nu, s.drift_acceleration);
    s.pending_gravity = select(set_aside_, zero, s.pending_gravity);
    s.pending_gravity = select(old, past[h.pending], s.pending_gravity);
    s.fresh = (s.fresh & !set_aside_) | (set_aside_ & fresh_);
    step::record_contacts(robot_, set_aside_, true);
  }
  store_field(s.q, t.nq, arrays.q);
  store_field(s.u, t.nu, arrays.u);
  step::copy(s.q, t.nq, past + h.q);
  step::copy(s.u, t.nu, past + h.u);
  step::copy(s.impulse, 3 * t.num_points, past + h.impulse);
  step::copy(s.earlier_impulse, 3 * t.num_points, past + h.earlier);
  step::copy(s.drift_acceleration, t.nu, past + h.drift);
  past[h.pending] = s.pending_gravity;
  past[h.fresh] = select(s.fresh, one, zero);
  past[h.aside] = select(set_aside_, one, zero);

  store_field(contacts_.impulse, 3 * t.num_points, arrays.contact_impulse);
  const Mask<S>* active = contacts_.active;
  const int points = t.num_points;
  for (int lane = 0; lane < kWidth; ++lane) {
    Flag* flags = arrays.contact_active + long(envs_[lane]) * points;
    for (int k = 0; k < points; ++k) flags[k] = get_lane(active[k], lane);
  }

  const Mask<S> non_finite = non_finite_ | set_aside_, unconverged = unconverged_ & !set_aside_;
  StatusBits bits = 0;
  for (int lane = 0; lane < kWidth; ++lane) {
    const bool dropped = get_lane(set_aside_, lane);
    const int env = envs_[lane];
    StatusBits& status = arrays.status[env];
    if (!arrays.continues) status = 0;
    status |= (get_lane(unconverged, lane) ? 1u : 0u) | (get_lane(non_finite, lane) ? 2u : 0u);
    if (first + lane < num_envs) bits |= status;
    T& residual = static_cast<T*>(arrays.residual)[env];
    const T before = arrays.continues ? residual : T(0);
    const T now = dropped ? T(0) : get_lane(residual_, lane);
    residual = now > before ? now : before;
    // Step by step, as a world counts.
    const long done = dropped ? 0 : steps_ - long(get_lane(steps_failed_, lane));
    double time = arrays.time[env];
    for (long k = 0; k < done; ++k) time += settings.time_step;
    arrays.time[env] = time;
  }
  return bits;
}

}  // namespace stickslip::backend::inline STICKSLIP_KERNELS
