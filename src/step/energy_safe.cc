// The default step: it neither sinks nor explodes (docs/theory/step.md (S3)-(S14)).
//
// A step is a kick (gravity, drives, contact impulses, all at fixed q) and a drift (motion without
// forces over h). The drift is exact in kinetic energy, linear momentum and angular momentum: a
// second-order rule, then a projection on those invariants, which has a closed form. Contact
// dissipates in the kick; nothing else can change the energy. Overlap left by the drift is removed
// at the new configuration by a displacement that touches no velocity, and the work of lifting is
// paid by the motion. Where links turn far in one step, the step is cut (substeps).
//
// Kept between steps: q, u and a1 = -M^-1 C(q, u), all at the same time (robot_data.h).
#include <algorithm>
#include <cmath>

#include "step/robot_data.h"
#include "step/stage_timer.h"

namespace stickslip::step {
namespace {

constexpr double kMaxTurn = 0.25;           // largest rotation of base or joint in a substep [rad]
constexpr double kMaxCorrection = 0.2;      // largest rotation of an overlap correction [rad]
constexpr double kOverlapTolerance = 1e-7;  // [m]
// Half kick of the drift, as a share of the velocity in the kinetic metric.
constexpr double kDriftLimit = 0.5;
constexpr double kMaxScale = 1.1;  // largest factor of the energy projection

/// Invariants of the drift, taken after the kick at the old configuration.
struct Invariants {
  double kinetic;        // [J]
  Vec3<double> linear;   // momentum [kg m/s]
  Vec3<double> angular;  // momentum about the center of mass [kg m^2/s]
  Vec3<double> center;   // of mass, in the world [m]
  double given;          // energy the contact impulses gave, if positive [J]
  double lifted;         // fixed base: work of gravity against the overlap correction [J]
};

class EnergySafeStep {
 public:
  EnergySafeStep(RobotData& robot, const StepContext& context)
      : robot_(robot),
        context_(context),
        t_(robot.tree()),
        offset_(robot.offset()),
        nu_(robot.model->nu()),
        timer_(context.times) {}

  /// Advances by one whole time step. False: the result is not finite and must be dropped.
  bool run() {
    const double dt = context_.time_step, shortest = dt / context_.max_substeps;
    robot_.info = StepInfo{};
    robot_.info.substeps = 0;
    if (robot_.prepared_step == 0) start(dt);
    for (double left = dt; left > 1e-9 * dt;) {
      const double h = kick(left, shortest);
      if (!(h > 0)) return false;
      left -= h;
      Invariants invariants = take_invariants();
      drift(h, invariants);
      correct_overlap(invariants);
      if (!finite(robot_.q_new)) return false;
      std::copy(robot_.q_new.begin(), robot_.q_new.end(), robot_.state.q.begin());
      arrive(h, left > 1e-9 * dt ? left : dt, invariants);
      ++robot_.info.substeps;
    }
    robot_.state.time += dt;
    return finite(robot_.state.u);
  }

 private:
  double* u() { return robot_.state.u.data(); }
  const double* q() { return robot_.state.q.data(); }
  static bool finite(const std::vector<double>& values) {
    double sum = 0;
    for (double x : values) sum += std::fabs(x);
    return std::isfinite(sum);
  }

  // ---- kinematics and factor

  /// Everything at q; for a state from outside also the predictor of the first drift.
  void start(double h) {
    dynamics::compute_positions(t_, robot_.base_quaternion(q()), robot_.joints(q()));
    dynamics::compute_inertias(t_);
    refactor(h);
    if (!robot_.state.fresh) return;
    robot_.state.fresh = false;
    dynamics::compute_velocities(t_, robot_.angular(u()), u() + offset_);
    dynamics::multiply_lower(t_, robot_.linear(u()), u() + offset_);
    const double kinetic = kinetic_energy(u());
    drift_acceleration(u(), 0.5 * h, kinetic, robot_.state.drift_acceleration.data());
  }

  void factor(double h) {
    dynamics::factor_mass_matrix(t_, implicit_diagonal(robot_, h));
    robot_.prepared_step = h;
  }

  /// The same q with another implicit diagonal.
  void refactor(double h) {
    factor(h);
    if (!offset_) gravity_acceleration();
  }

  /// Fixed base: accelerations by gravity alone, at q.
  void gravity_acceleration() {
    std::fill(robot_.rates.begin(), robot_.rates.end(), 0.0);
    dynamics::compute_bias(t_, zero3<double>(), robot_.rates.data(), context_.gravity);
    dynamics::solve_lower_transposed<double>(t_, nullptr, dynamics::LinkForces::kAll);
    solve_lower(robot_.gravity_acceleration.data());
  }

  /// L^-1 x of the tree as a velocity of the robot (nu).
  void solve_lower(double* out) {
    double base[6];
    dynamics::solve_lower(t_, base, out + offset_);
    for (int k = 0; k < offset_; ++k) out[k] = base[k];
  }

  /// Kinetic energy of the velocity whose L-space coordinates the tree holds; the implicit diagonal
  /// is not mass.
  double kinetic_energy(const double* velocity) {
    double twice = dynamics::squared_norm(t_);
    if (const double* extra = implicit_diagonal(robot_, robot_.prepared_step))
      for (int j = 0; j < robot_.num_joints(); ++j)
        twice -= extra[j] * velocity[offset_ + j] * velocity[offset_ + j];
    return std::max(0.0, 0.5 * twice);
  }

  // ---- kick

  /// u_plus after a kick over h <= left, h as long as no link turns too far. Returns h, or 0 where
  /// it is not finite.
  double kick(double left, double shortest) {
    const StepInfo before = robot_.info;
    for (double h = left;;) {
      robot_.info = before;  // an attempt that is thrown away leaves no status
      if (implicit_diagonal(robot_, h) && robot_.prepared_step != h) refactor(h);
      free_motion(h);
      contacts(h);
      const double turn = h * fastest_turn(robot_.u_plus.data());
      if (!std::isfinite(turn) || !finite(robot_.u_plus)) return 0;
      if (turn <= kMaxTurn || h <= shortest * 1.0001) return h;
      h = std::max(shortest, std::min(0.5 * h, h * kMaxTurn / turn));
    }
  }

  /// Largest rate of rotation: base or revolute joint [rad/s].
  double fastest_turn(const double* velocity) const {
    const Vec3<double> w = robot_.angular(velocity);
    double fastest = std::sqrt(dot(w, w));
    for (int j = 0; j < robot_.num_joints(); ++j)
      if (robot_.model->joints()[j].type != JointType::kPrismatic)
        fastest = std::max(fastest, std::fabs(velocity[offset_ + j]));
    return fastest;
  }

  /// (S3) u_free = u + gravity + drives over h; leaves its link velocities and y = L u_free in the
  /// tree.
  void free_motion(double h) {
    double* free = robot_.u_free.data();
    std::copy(robot_.state.u.begin(), robot_.state.u.end(), free);
    late_ = balanced() ? 0 : 0.5 * h;
    fall_ = robot_.state.pending_gravity + h - late_;
    add_gravity(fall_, free);
    double* tau = robot_.force.data();
    if (control_force(robot_, q(), u(), h, tau)) {
      t_.base.force = zero_spatial<double>();
      if (offset_) t_.base.force = {{tau[3], tau[4], tau[5]}, {tau[0], tau[1], tau[2]}};
      dynamics::solve_lower_transposed(t_, tau + offset_, dynamics::LinkForces::kBaseOnly);
      solve_lower(robot_.delta.data());
      for (int k = 0; k < nu_; ++k) free[k] = madd(h, robot_.delta[k], free[k]);
    }
    dynamics::compute_velocities(t_, robot_.angular(free), free + offset_);
    dynamics::multiply_lower(t_, robot_.linear(free), free + offset_);
    timer_.end(&StageTimes::dynamics);
  }

  /// A drive may hold the weight: its kick is whole, so gravity's must be, or a hovering robot
  /// climbs and a held arm reports a speed. Joint drives of a floating robot cannot.
  bool balanced() const {
    const RobotControl& c = robot_.control;
    if (!offset_) return c.force || c.pd;
    return c.force && std::any_of(c.generalized_force.begin(), c.generalized_force.begin() + 6,
                                  [](double x) { return x != 0; });
  }

  /// velocity += gravity over `time`. A floating base falls as a whole; a fixed one needs M^-1.
  void add_gravity(double time, double* velocity) const {
    if (offset_) {
      velocity[0] = madd(time, context_.gravity.x, velocity[0]);
      velocity[1] = madd(time, context_.gravity.y, velocity[1]);
      velocity[2] = madd(time, context_.gravity.z, velocity[2]);
    } else {
      for (int j = 0; j < nu_; ++j)
        velocity[j] = madd(time, robot_.gravity_acceleration[j], velocity[j]);
    }
  }

  /// (S5) u_plus = u_free + M^-1 J^T lambda; the tree's y becomes L u_plus.
  void contacts(double h) {
    ContactStage& c = robot_.contacts;
    robot_.u_plus = robot_.u_free;
    given_ = 0;
    pushed_ = false;
    c.forget();
    robot_.contact_origin = robot_.base_position(q());
    if (context_.ground) {
      const double clearance = robot_.base_position(q()).z - context_.ground_height;
      c.detect_reachable(t_, clearance, robot_.linear(robot_.u_free.data()), h);
    }
    timer_.end(&StageTimes::detection);
    robot_.info.contacts = c.count();
    if (c.count() == 0) {
      std::fill(robot_.state.impulse.begin(), robot_.state.impulse.end(), 0.0);
      return;
    }
    c.allow_closing(h, kOverlapTolerance);
    gravity_at_contacts();
    c.add_restitution(fall_, h);
    c.build_problem(t_, false);
    timer_.end(&StageTimes::delassus);
    const double worst = robot_.info.residual;
    c.solve(*context_.solver, robot_.state.impulse.data(), h, robot_.info);
    robot_.info.residual = std::max(worst, robot_.info.residual);
    pushed_ = c.any_impulse();
    if (pushed_) {
      c.add_impulses(t_);
      solve_lower(robot_.u_plus.data());
      // What is left of gravity's kick belongs to the time after the impulses: its work is the
      // weight's, not theirs.
      given_ = std::max(0.0, c.work() - late_ * c.work_rate_of_gravity());
    }
    timer_.end(&StageTimes::solve);
  }

  /// Acceleration of each contact point by gravity alone, J g^.
  void gravity_at_contacts() {
    ContactStage& c = robot_.contacts;
    if (offset_) return c.set_gravity(context_.gravity);
    dynamics::compute_velocities(t_, zero3<double>(), robot_.gravity_acceleration.data());
    c.take_gravity(t_);
  }

  // ---- drift

  Invariants take_invariants() {
    const Spatial<double> p = dynamics::base_momentum(t_);
    const RigidInertia<double>& all = t_.base.composite;
    const Vec3<double> c = all.mass > 0 ? all.h * (1 / all.mass) : zero3<double>();
    return {kinetic_energy(robot_.u_plus.data()), p.lin,  p.ang - cross(c, p.lin),
            c + robot_.base_position(q()),        given_, 0};
  }

  /// -M^-1 C at (q, velocity) into `out`, scaled so that a kick of it over `time` stays below
  /// kDriftLimit of the speed that the kinetic energy stands for.
  void drift_acceleration(const double* velocity, double time, double kinetic, double* out) {
    dynamics::compute_bias(t_, robot_.angular(velocity), velocity + offset_, zero3<double>());
    dynamics::solve_lower_transposed<double>(t_, nullptr, dynamics::LinkForces::kAll);
    const double size = time * std::sqrt(dynamics::squared_norm(t_));
    const double limit = kDriftLimit * std::sqrt(2 * kinetic);
    solve_lower(out);
    if (size <= limit) return;
    for (int k = 0; k < nu_; ++k) out[k] *= limit / size;
  }

  /// (S7) w = u+ + (h/2) a(q, u+ + (h/2) a1), q_new = q (+) h w; leaves w in u_free and positions
  /// at q_new in the tree.
  void drift(double h, const Invariants& invariants) {
    const RobotState& s = robot_.state;
    double *w = robot_.u_free.data(), *plus = robot_.u_plus.data(), *a = robot_.delta.data();
    for (int k = 0; k < nu_; ++k) w[k] = madd(0.5 * h, s.drift_acceleration[k], plus[k]);
    drift_acceleration(w, 0.5 * h, invariants.kinetic, a);
    for (int k = 0; k < nu_; ++k) w[k] = madd(0.5 * h, a[k], plus[k]);
    std::copy(s.q.begin(), s.q.end(), robot_.q_new.begin());
    integrate_configuration(robot_, robot_.q_new.data(), w, h);
    positions_at_new_q();
  }

  void positions_at_new_q() {
    const double* q_new = robot_.q_new.data();
    dynamics::compute_positions(t_, robot_.base_quaternion(q_new), robot_.joints(q_new));
  }

  /// (S8) Lifts q_new out of the ground, with normal rows at q_new and the factor of q.
  void correct_overlap(Invariants& invariants) {
    ContactStage& c = robot_.contacts;
    if (c.count() == 0) return;
    const double clearance = robot_.base_position(robot_.q_new.data()).z - context_.ground_height;
    if (!c.correct_overlap(t_, clearance, kOverlapTolerance)) return;
    double* delta = robot_.delta.data();
    solve_lower(delta);
    const double turn = fastest_turn(delta),
                 scale = turn > kMaxCorrection ? kMaxCorrection / turn : 1;
    if (!offset_)
      invariants.lifted = scale * dot(dynamics::base_momentum(t_).lin, context_.gravity);
    integrate_configuration(robot_, robot_.q_new.data(), delta, scale);
    positions_at_new_q();
  }

  // ---- arrival at the new configuration

  /// Second half kick of the drift and projection on its invariants. `next`: length of the step to
  /// come.
  void arrive(double h, double next, const Invariants& invariants) {
    RobotState& s = robot_.state;
    dynamics::compute_inertias(t_);
    factor(next);
    const double* w = robot_.u_free.data();
    double* a1 = s.drift_acceleration.data();
    drift_acceleration(w, 0.5 * h, invariants.kinetic, a1);
    for (int k = 0; k < nu_; ++k) u()[k] = madd(0.5 * h, a1[k], w[k]);
    project(h, invariants);
    if (!offset_) gravity_acceleration();
    // Without contact the second half of gravity's kick completes u; in contact the ground will
    // take part in it (S14).
    s.pending_gravity = pushed_ ? late_ : 0;
    if (!pushed_ && late_ > 0) add_gravity(late_, u());
    timer_.end(&StageTimes::integrate);
  }

  /// Gives u the momentum and energy of the invariants: docs/theory/step.md (S9)-(S12).
  void project(double h, const Invariants& v) {
    dynamics::compute_velocities(t_, robot_.angular(u()), u() + offset_);
    dynamics::multiply_lower(t_, robot_.linear(u()), u() + offset_);
    const double kinetic = kinetic_energy(u());
    if (!offset_) {
      scale_relative(v.kinetic + v.lifted - v.given, kinetic, v.kinetic, zero_spatial<double>());
      return;
    }
    const RigidInertia<double>& locked = t_.base.composite;
    const Vec3<double> c = locked.h * (1 / locked.mass);
    const Spatial<double> p = dynamics::base_momentum(t_);
    const Spatial<double> wanted{v.angular + cross(c, v.linear), v.linear};
    const Spatial<double> now = locked_velocity(p), then = locked_velocity(wanted);
    // Motion of the locked robot and motion relative to it are orthogonal in the kinetic metric.
    const double relative = kinetic - 0.5 * dot(p, now);
    const Spatial<double> change = locked_velocity(wanted - p);
    double shift[6];
    dynamics::to_rows(change, shift);
    for (int k = 0; k < 6; ++k) u()[k] += shift[k];
    // What gravity's kicks gave or took follows the center of mass; the drift moves it
    // ballistically, a correction does not.
    const Vec3<double> moved = c + robot_.base_position(q()) - v.center;
    const double lifted = dot(context_.gravity, nmadd(v.linear, h, moved * locked.mass));
    scale_relative(v.kinetic + lifted - v.given - 0.5 * dot(wanted, then), relative, v.kinetic,
                   then);
  }

  /// Scales the motion relative to `locked` so that its kinetic energy becomes `wanted`.
  void scale_relative(double wanted, double relative, double total, const Spatial<double>& locked) {
    if (!(relative > 1e-10 * total)) return;
    const double f = wanted > 0 ? std::min(kMaxScale, std::sqrt(wanted / relative)) : 0;
    double base[6];
    dynamics::to_rows(locked, base);
    for (int k = 0; k < offset_; ++k) u()[k] = madd(f, u()[k] - base[k], base[k]);
    for (int k = offset_; k < nu_; ++k) u()[k] *= f;
  }

  /// Velocity of the whole robot, joints locked, with momentum p about the base origin: through the
  /// center of mass.
  Spatial<double> locked_velocity(const Spatial<double>& p) const {
    const RigidInertia<double>& i = t_.base.composite;
    const Vec3<double> c = i.h * (1 / i.mass);
    const Vec3<double> l = p.ang - cross(c, p.lin);
    // Inertia about the center of mass, inverted by cofactors.
    const double cc = dot(c, i.h);
    const double a = i.rot.xx - (cc - c.x * i.h.x), b = i.rot.xy + c.x * i.h.y,
                 d = i.rot.xz + c.x * i.h.z, e = i.rot.yy - (cc - c.y * i.h.y),
                 f = i.rot.yz + c.y * i.h.z, g = i.rot.zz - (cc - c.z * i.h.z);
    const double i0 = e * g - f * f, i1 = d * f - b * g, i2 = b * f - d * e, i3 = a * g - d * d,
                 i4 = b * d - a * f, i5 = a * e - b * b, inv = 1 / (a * i0 + b * i1 + d * i2);
    const Vec3<double> w = Sym3<double>{i0, i1, i2, i3, i4, i5} * l * inv;
    return {w, p.lin * (1 / i.mass) - cross(w, c)};
  }

  RobotData& robot_;
  const StepContext& context_;
  dynamics::Tree<double>& t_;
  const int offset_, nu_;
  StageTimer timer_;
  double fall_ = 0;      // time of gravity that the last kick took ...
  double late_ = 0;      // ... and that it left for later [s]
  double given_ = 0;     // energy the impulses of the last kick gave [J]
  bool pushed_ = false;  // the last kick had a contact impulse
};

}  // namespace

void step_energy_safe(RobotData& robot, const StepContext& context) {
  robot.backup = robot.state;
  if (EnergySafeStep(robot, context).run()) return;
  robot.state = robot.backup;
  robot.prepared_step = 0;
  robot.contacts.forget();
  robot.info.status = StepStatus::kNonFinite;
}

}  // namespace stickslip::step
