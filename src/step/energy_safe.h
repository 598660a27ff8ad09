// The default step: it neither sinks nor explodes (docs/theory/step.md (S3)-(S14)).
//
// A step is a kick (gravity, drives, contact impulses, all at fixed q) and a drift (motion without
// forces over h). The drift is exact in kinetic energy, linear momentum and angular momentum: a
// second-order rule, then a projection on those invariants, which has a closed form. Contact
// dissipates in the kick; nothing else can change the energy. Overlap left by the drift is removed
// at the new configuration by a displacement that touches no velocity, and the work of lifting is
// paid by the motion. Where links turn far in one step, the step is cut (substeps).
//
// Kept between steps: q, u and a1 = -M^-1 C(q, u), all at the same time (LaneState).
//
// Lanes go through the substeps together. One that is through, or failed, keeps its state while the
// others go on; one whose kick was short enough goes through the same kick again, with the same
// bits, while others shorten theirs.
#pragma once
#include "dynamics/dynamics.h"
#include "step/control.h"
#include "step/stage_timer.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template <class S>
class EnergySafeStep {
 public:
  EnergySafeStep(RobotLanes<S>& robot, const StepSettings& settings)
      : robot_(robot),
        settings_(settings),
        tables_(*robot.tables),
        t_(*robot.tree),
        offset_(robot.offset()),
        nu_(robot.tables->nu),
        timer_(settings) {}

  /// Advances by one whole time step. Lanes whose result is not finite, to be dropped.
  Mask<S> run() {
    const S dt = number(settings_.time_step),
            shortest = number(settings_.time_step / settings_.max_substeps);
    const S end = number(1e-9 * settings_.time_step);
    robot_.info.clear();
    robot_.info.substeps = 0;
    if (!all(robot_.prepared_step > number(0))) start(dt);
    S left = dt;
    Mask<S> live = !none<S>(), failed = none<S>();
    while (any(live)) {
      const S h = kick(left, shortest, live);
      fail(live, failed, live & !kick_finite_);
      record_contacts(robot_, live);
      left = select(live, left - h, left);
      Invariants invariants = take_invariants();
      drift(h, invariants, live);
      correct_overlap(invariants, live);
      fail(live, failed, live & !are_finite(robot_.q_new, tables_.nq));
      commit(live, robot_.q_new, tables_.nq, state().q);
      arrive(h, select(left > end, left, dt), invariants, live);
      ++robot_.info.substeps;
      live = live & (left > end);
    }
    return failed | !are_finite(state().u, nu_);
  }

 private:
  static constexpr double kMaxTurn = 0.25;  // largest rotation of base or joint in a substep [rad]
  static constexpr double kMaxCorrection = 0.2;  // largest rotation of an overlap correction [rad]
  // Half kick of the drift, as a share of the velocity in the kinetic metric.
  static constexpr double kDriftLimit = 0.5;
  static constexpr double kMaxScale = 1.1;  // largest factor of the energy projection
  // Overlap that counts as none [m]; in float about the rounding of a height.
  static constexpr double kOverlapTolerance = sizeof(Value<S>) == 4 ? 1e-6 : 1e-7;

  /// Invariants of the drift, taken after the kick at the old configuration.
  struct Invariants {
    S kinetic;        // [J]
    Vec3<S> linear;   // momentum [kg m/s]
    Vec3<S> angular;  // momentum about the center of mass [kg m^2/s]
    Vec3<S> center;   // of mass, in the world [m]
    S given;          // energy the contact impulses gave, if positive [J]
    S lifted;         // fixed base: work of gravity against the overlap correction [J]
  };

  static S number(double x) { return constant<S>(x); }
  static void fail(Mask<S>& live, Mask<S>& failed, Mask<S> now) {
    failed = failed | now;
    live = live & !now;
  }
  /// A zero of the state is +0, whichever way it came about.
  static void commit(Mask<S> live, const S* from, int n, S* to) {
    for (int k = 0; k < n; ++k) to[k] = select(live, from[k] + number(0), to[k]);
  }
  LaneState<S>& state() { return robot_.state; }
  const S* q() const { return robot_.state.q; }
  const S* u() const { return robot_.state.u; }

  // ---- kinematics and factor

  /// Everything at q; for a state from outside also the predictor of the first drift.
  void start(S h) {
    robot_.compute_positions(q());
    dynamics::compute_inertias(t_);
    refactor(h);
    const Mask<S> fresh = state().fresh;
    if (!any(fresh)) return;
    state().fresh = none<S>();
    multiply_lower(u());
    const S kinetic = kinetic_energy(u());
    drift_acceleration(u(), number(0.5) * h, kinetic, robot_.delta);
    copy_where(fresh, robot_.delta, nu_, state().drift_acceleration);
  }

  void factor(S h) {
    dynamics::factor_mass_matrix<S>(t_, implicit_diagonal(robot_, h));
    robot_.prepared_step = h;
  }

  /// The same q with another implicit diagonal.
  void refactor(S h) {
    factor(h);
    if (!offset_) gravity_acceleration();
  }

  /// Fixed base: accelerations by gravity alone, at q.
  void gravity_acceleration() {
    for (int k = 0; k < nu_; ++k) robot_.rates[k] = number(0);
    dynamics::solve_bias(t_, zero3<S>(), robot_.rates, robot_.control.gravity);
    solve_lower(robot_.gravity_acceleration);
  }

  /// L^-1 x of the tree as a velocity of the robot (nu); returns |x|^2.
  S solve_lower(S* out) {
    S base[6];
    const S square = dynamics::solve_lower(t_, base, out + offset_);
    for (int k = 0; k < offset_; ++k) out[k] = base[k];
    return square;
  }

  /// Link velocities, and x = L velocity.
  void multiply_lower(const S* velocity) {
    dynamics::multiply_lower(t_, robot_.angular(velocity), robot_.linear(velocity),
                             velocity + offset_);
  }

  /// Kinetic energy of the velocity whose L-space coordinates the tree holds; the implicit diagonal
  /// is not mass.
  S kinetic_energy(const S* velocity) {
    S twice = dynamics::squared_norm(t_);
    if (const S* extra = implicit_diagonal(robot_, robot_.prepared_step))
      for (int j = 0; j < tables_.num_joints; ++j)
        twice = twice - extra[j] * velocity[offset_ + j] * velocity[offset_ + j];
    return max(number(0), number(0.5) * twice);
  }

  // ---- kick

  /// u_plus after a kick over h <= left, h as long as no link turns too far. Returns h; lanes where
  /// the kick is finite are in kick_finite_.
  S kick(S left, S shortest, Mask<S> live) {
    const LaneInfo<S> before = robot_.info;
    const int numbers = 3 * tables_.num_points;
    copy(state().impulse, numbers, robot_.start_impulse);
    for (S h = left;;) {
      robot_.info = before;  // an attempt that is thrown away leaves no status
      if (implicit_diagonal(robot_, h) && any(different(robot_.prepared_step, h))) refactor(h);
      free_motion(h);
      contacts(h, live);
      const S turn = h * fastest_turn(robot_.u_plus);
      kick_finite_ = is_finite(turn) & are_finite(robot_.u_plus, nu_);
      const Mask<S> retry =
          live & kick_finite_ & (turn > number(kMaxTurn)) & (h > shortest * number(1.0001));
      if (!any(retry)) return h;
      // Lanes that retry start at the impulses that the attempt left, the others where they
      // started.
      copy_where(retry, state().impulse, numbers, robot_.start_impulse);
      copy(robot_.start_impulse, numbers, state().impulse);
      h = select(retry, max(shortest, min(number(0.5) * h, h * number(kMaxTurn) / turn)), h);
    }
  }
  static Mask<S> different(S a, S b) { return (a < b) | (a > b); }

  /// Largest rate of rotation: base or revolute joint [rad/s].
  S fastest_turn(const S* velocity) const {
    const Vec3<S> w = robot_.angular(velocity);
    S fastest = sqrt(dot(w, w));
    for (int j = 0; j < tables_.num_joints; ++j)
      if (!tables_.prismatic[j]) fastest = max(fastest, abs(velocity[offset_ + j]));
    return fastest;
  }

  /// (S3) u_free = u + gravity + drives over h; leaves its link velocities and y = L u_free in the
  /// tree.
  void free_motion(S h) {
    S* free = robot_.u_free;
    copy(u(), nu_, free);
    late_ = select(balanced(), number(0), number(0.5) * h);
    fall_ = state().pending_gravity + h - late_;
    add_gravity(fall_, free);
    if (control_force(robot_, q(), u(), h)) {
      set_forces(robot_);
      dynamics::solve_lower_transposed<S>(t_, robot_.force + offset_);
      solve_lower(robot_.delta);
      for (int k = 0; k < nu_; ++k) free[k] = madd(h, robot_.delta[k], free[k]);
    }
    multiply_lower(free);
    timer_.end(kDynamics);
  }

  /// A drive may hold the weight: its kick is whole, so gravity's must be, or a hovering robot
  /// climbs and a held arm reports a speed. Joint drives of a floating robot cannot.
  Mask<S> balanced() const {
    return offset_ ? robot_.control.drives_base : robot_.control.drives_joints;
  }

  /// velocity += gravity over `time`. A floating base falls as a whole; a fixed one needs M^-1.
  void add_gravity(S time, S* velocity) const {
    const Vec3<S>& g = robot_.control.gravity;
    if (offset_) {
      velocity[0] = madd(time, g.x, velocity[0]);
      velocity[1] = madd(time, g.y, velocity[1]);
      velocity[2] = madd(time, g.z, velocity[2]);
    } else {
      for (int j = 0; j < nu_; ++j)
        velocity[j] = madd(time, robot_.gravity_acceleration[j], velocity[j]);
    }
  }

  /// (S5) u_plus = u_free + M^-1 J^T lambda; the tree's y becomes L u_plus.
  void contacts(S h, Mask<S> live) {
    ContactStage<S>& c = robot_.contacts;
    copy(robot_.u_free, nu_, robot_.u_plus);
    given_ = number(0);
    pushed_ = none<S>();
    c.forget();
    robot_.contact_origin = robot_.base_position(q());
    if (settings_.ground) {
      const S clearance = robot_.contact_origin.z - number(settings_.ground_height);
      c.detect_reachable(t_, clearance, robot_.linear(robot_.u_free), h, live);
    }
    timer_.end(kDetection);
    robot_.info.contacts = c.count();
    if (c.count() == 0) return clear_where(live, 3 * tables_.num_points, state().impulse);
    c.allow_closing(h, kOverlapTolerance);
    gravity_at_contacts();
    c.add_restitution(fall_, h);
    c.build_problem(t_, robot_.control.friction, false);
    timer_.end(kDelassus);
    const LaneInfo<S> before = robot_.info;
    c.start_at(settings_.warm_start ? state().impulse : nullptr, nullptr, h);
    c.solve(settings_, live, robot_.info);
    c.write_forces(live, h, state().impulse);
    robot_.info.residual = max(before.residual, robot_.info.residual);
    robot_.info.unconverged = before.unconverged | robot_.info.unconverged;
    pushed_ = c.any_impulse();
    if (any(pushed_)) {
      c.add_impulses(t_, pushed_);
      solve_lower(robot_.delta);
      copy_where(pushed_, robot_.delta, nu_, robot_.u_plus);
      // What is left of gravity's kick belongs to the time after the impulses: its work is the
      // weight's, not theirs.
      given_ =
          select(pushed_, max(number(0), c.work() - late_ * c.work_rate_of_gravity()), number(0));
    }
    timer_.end(kSolve);
  }

  /// Acceleration of each contact point by gravity alone, J g^.
  void gravity_at_contacts() {
    ContactStage<S>& c = robot_.contacts;
    if (offset_) return c.set_gravity(robot_.control.gravity);
    dynamics::compute_velocities(t_, zero3<S>(), robot_.gravity_acceleration);
    c.take_gravity(t_);
  }

  // ---- drift

  Invariants take_invariants() {
    const Spatial<S> p = dynamics::base_momentum(t_);
    const Vec3<S> c = center_of_mass();
    return {kinetic_energy(robot_.u_plus), p.lin,  p.ang - cross(c, p.lin),
            c + robot_.base_position(q()), given_, number(0)};
  }

  /// Of the whole tree, relative to the base origin; zero where nothing has mass.
  Vec3<S> center_of_mass() const {
    const RigidInertia<S>& all_of_it = t_.base.composite;
    const Mask<S> heavy = all_of_it.mass > number(0);
    const S inverse = number(1) / select(heavy, all_of_it.mass, number(1));
    const Vec3<S> c = all_of_it.h * inverse;
    return {select(heavy, c.x, number(0)), select(heavy, c.y, number(0)),
            select(heavy, c.z, number(0))};
  }

  /// -M^-1 C at (q, velocity) into `out`, scaled so that a kick of it over `time` stays below
  /// kDriftLimit of the speed that the kinetic energy stands for.
  void drift_acceleration(const S* velocity, S time, S kinetic, S* out) {
    dynamics::solve_bias(t_, robot_.angular(velocity), velocity + offset_, zero3<S>());
    finish_drift_acceleration(time, kinetic, out);
  }
  /// The same from L^-T (-C) in the tree's x.
  void finish_drift_acceleration(S time, S kinetic, S* out) {
    const S size = time * sqrt(solve_lower(out));
    const S limit = number(kDriftLimit) * sqrt(number(2) * kinetic);
    const Mask<S> within = size <= limit;
    if (all(within)) return;
    const S factor = select(within, number(1), limit / select(within, number(1), size));
    for (int k = 0; k < nu_; ++k) out[k] = out[k] * factor;
  }

  /// (S7) w = u+ + (h/2) a(q, u+ + (h/2) a1), q_new = q (+) h w; leaves w in u_free and positions
  /// at q_new in the tree.
  void drift(S h, const Invariants& invariants, Mask<S> live) {
    const S half = number(0.5) * h;
    S *w = robot_.u_free, *plus = robot_.u_plus, *a = robot_.delta;
    for (int k = 0; k < nu_; ++k) w[k] = madd(half, state().drift_acceleration[k], plus[k]);
    drift_acceleration(w, half, invariants.kinetic, a);
    for (int k = 0; k < nu_; ++k) w[k] = madd(half, a[k], plus[k]);
    move(q(), w, h, live);
  }

  /// q_new = from (+) h velocity in these lanes, elsewhere q_new = from; positions follow.
  void move(const S* from, const S* velocity, S h, Mask<S> lanes) {
    S* to = robot_.q_new;
    S* moved = robot_.q_moved;
    integrate_configuration(tables_, from, velocity, h, moved);
    for (int k = 0; k < tables_.nq; ++k) to[k] = select(lanes, moved[k], from[k]);
    robot_.compute_positions(to);
  }

  /// (S8) Lifts q_new out of the ground, with normal rows at q_new and the factor of q.
  void correct_overlap(Invariants& invariants, Mask<S> live) {
    ContactStage<S>& c = robot_.contacts;
    if (c.count() == 0) return;
    const S clearance = robot_.base_position(robot_.q_new).z - number(settings_.ground_height);
    const Mask<S> overlap = live & c.correct_overlap(t_, clearance, kOverlapTolerance);
    if (!any(overlap)) return;
    S* delta = robot_.delta;
    solve_lower(delta);
    const S turn = fastest_turn(delta);
    const Mask<S> far = turn > number(kMaxCorrection);
    const S scale = select(far, number(kMaxCorrection) / select(far, turn, number(1)), number(1));
    if (!offset_)
      invariants.lifted = select(
          overlap, scale * dot(dynamics::base_momentum(t_).lin, robot_.control.gravity), number(0));
    move(robot_.q_new, delta, scale, overlap);
  }

  // ---- arrival at the new configuration

  /// Second half kick of the drift and projection on its invariants. `next`: length of the step to
  /// come.
  void arrive(S h, S next, const Invariants& invariants, Mask<S> live) {
    const S half = number(0.5) * h, *w = robot_.u_free;
    S *a1 = robot_.delta, *u_new = robot_.u_new;
    dynamics::factor_and_solve_bias(t_, implicit_diagonal(robot_, next), robot_.angular(w),
                                    w + offset_, zero3<S>());
    robot_.prepared_step = next;
    finish_drift_acceleration(half, invariants.kinetic, a1);
    copy_where(live, a1, nu_, state().drift_acceleration);
    for (int k = 0; k < nu_; ++k) u_new[k] = madd(half, a1[k], w[k]);
    project(h, invariants, u_new);
    if (!offset_) gravity_acceleration();
    // Without contact the second half of gravity's kick completes u; in contact the ground will
    // take part in it (S14).
    add_gravity(select(pushed_, number(0), late_), u_new);
    state().pending_gravity =
        select(live, select(pushed_, late_, number(0)), state().pending_gravity);
    commit(live, u_new, nu_, state().u);
    timer_.end(kIntegrate);
  }

  /// Gives u the momentum and energy of the invariants: docs/theory/step.md (S9)-(S12).
  void project(S h, const Invariants& v, S* u_new) {
    multiply_lower(u_new);
    const S kinetic = kinetic_energy(u_new);
    if (!offset_) {
      scale_relative(v.kinetic + v.lifted - v.given, kinetic, v.kinetic, zero_spatial<S>(), u_new);
      return;
    }
    const Vec3<S> c = center_of_mass();
    const Spatial<S> p = dynamics::base_momentum(t_);
    const Spatial<S> wanted{v.angular + cross(c, v.linear), v.linear};
    const Spatial<S> now = locked_velocity(p), then = locked_velocity(wanted);
    // Motion of the locked robot and motion relative to it are orthogonal in the kinetic metric.
    const S relative = kinetic - number(0.5) * dot(p, now);
    const Spatial<S> change = locked_velocity(wanted - p);
    S shift[6];
    dynamics::to_rows(change, shift);
    for (int k = 0; k < 6; ++k) u_new[k] = u_new[k] + shift[k];
    // What gravity's kicks gave or took follows the center of mass; the drift moves it
    // ballistically, a correction does not.
    const Vec3<S> moved = c + robot_.base_position(q()) - v.center;
    const S lifted =
        dot(robot_.control.gravity, nmadd(v.linear, h, moved * t_.base.composite.mass));
    scale_relative(v.kinetic + lifted - v.given - number(0.5) * dot(wanted, then), relative,
                   v.kinetic, then, u_new);
  }

  /// Scales the motion relative to `locked` so that its kinetic energy becomes `wanted`.
  void scale_relative(S wanted, S relative, S total, const Spatial<S>& locked, S* u_new) {
    const Mask<S> moving = relative > number(kNoMotion) * total;
    if (!any(moving)) return;
    const Mask<S> some = moving & (wanted > number(0));
    const S ratio = select(some, wanted, number(0)) / select(moving, relative, number(1));
    const S f = select(some, min(number(kMaxScale), sqrt(ratio)), number(0));
    S base[6];
    dynamics::to_rows(locked, base);
    for (int k = 0; k < offset_; ++k)
      u_new[k] = select(moving, madd(f, u_new[k] - base[k], base[k]), u_new[k]);
    for (int k = offset_; k < nu_; ++k) u_new[k] = select(moving, u_new[k] * f, u_new[k]);
  }
  // Share of the kinetic energy below which relative motion is rounding.
  static constexpr double kNoMotion = sizeof(Value<S>) == 4 ? 1e-5 : 1e-10;

  /// Velocity of the whole robot, joints locked, with momentum p about the base origin: through the
  /// center of mass.
  Spatial<S> locked_velocity(const Spatial<S>& p) const {
    const RigidInertia<S>& i = t_.base.composite;
    const S heavy = number(1) / i.mass;
    const Vec3<S> c = i.h * heavy;
    const Vec3<S> l = p.ang - cross(c, p.lin);
    // Inertia about the center of mass, inverted by cofactors.
    const S cc = dot(c, i.h);
    const S a = i.rot.xx - (cc - c.x * i.h.x), b = i.rot.xy + c.x * i.h.y,
            d = i.rot.xz + c.x * i.h.z, e = i.rot.yy - (cc - c.y * i.h.y),
            f = i.rot.yz + c.y * i.h.z, g = i.rot.zz - (cc - c.z * i.h.z);
    const S i0 = e * g - f * f, i1 = d * f - b * g, i2 = b * f - d * e, i3 = a * g - d * d,
            i4 = b * d - a * f, i5 = a * e - b * b,
            inverse = number(1) / (a * i0 + b * i1 + d * i2);
    const Vec3<S> w = Sym3<S>{i0, i1, i2, i3, i4, i5} * l * inverse;
    return {w, p.lin * heavy - cross(w, c)};
  }

  RobotLanes<S>& robot_;
  const StepSettings& settings_;
  const RobotTables& tables_;
  dynamics::Tree<S>& t_;
  const int offset_, nu_;
  StageTimer timer_;
  S fall_;          // time of gravity that the last kick took ...
  S late_;          // ... and that it left for later [s]
  S given_;         // energy the impulses of the last kick gave [J]
  Mask<S> pushed_;  // the last kick had a contact impulse
  Mask<S> kick_finite_;
};

/// One time step. The state of a lane only changes if its result is finite.
template <class S>
void step_energy_safe(RobotLanes<S>& robot, const StepSettings& settings) {
  const RobotTables& t = *robot.tables;
  LaneState<S>&s = robot.state, &backup = robot.backup;
  copy_state(t, s, backup);
  const Mask<S> failed = EnergySafeStep<S>(robot, settings).run();
  if (!any(failed)) return;
  const S zero = constant<S>(0);
  copy_state_where(t, failed, backup, s);
  robot.prepared_step = select(failed, zero, robot.prepared_step);
  robot.contacts.forget(failed);
  record_contacts(robot, failed, true);
  robot.info.non_finite = failed;
  robot.info.unconverged = robot.info.unconverged & !failed;
  robot.info.residual = select(failed, zero, robot.info.residual);
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
