// Trot: gait clock, stance force distribution, swing legs.
//
// Stance: desired wrench b = (m (a + g), I alpha) about the center of mass, forces f of the stance
// feet that
//   minimize |A f - b|^2_S + eps |f|^2,  A = [1; [r_i]x],
// solved in its 6x6 dual f = A' (A A' + eps S^-1)^-1 b and put into the friction cone; tau =
// gravity - J' f. Two diagonal feet cannot turn the torso about the line between them: the
// footholds balance that one. Swing: computed torque, tau = M J^-1 (a + kp (p_des - p) + kd (v_des
// - v)) + gravity.
#include "scenes/trot_controller.h"

#include <algorithm>
#include <cmath>

#include "scenes/vector.h"

namespace stickslip::scenes {
namespace {

constexpr Vector3 kCenter{0, 0, -0.03};     // of mass in the base frame, legs in stance [m]
constexpr Vector3 kInertia{1.0, 2.2, 2.4};  // of the whole robot about it [kg m^2]
// From this part of the swing on the foothold stays: a foot that still follows the speed of the
// body lands moving and slips (measured: 0.5 m/s, 0.8 mm per step).
constexpr double kDecided = 0.75;
constexpr double kTouch = 5e-4;  // a foot this close to the ground has landed [m]

// x of A x = b for a symmetric positive definite 6x6 matrix (Cholesky, in place).
void solve6(double a[6][6], double b[6]) {
  for (int j = 0; j < 6; ++j) {
    for (int i = j; i < 6; ++i) {
      double s = a[i][j];
      for (int k = 0; k < j; ++k) s -= a[i][k] * a[j][k];
      a[i][j] = i == j ? std::sqrt(std::max(s, 1e-12)) : s / a[j][j];
    }
  }
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
    b[i] /= a[i][i];
  }
  for (int i = 5; i >= 0; --i) {
    for (int k = i + 1; k < 6; ++k) b[i] -= a[k][i] * b[k];
    b[i] /= a[i][i];
  }
}

// J^-1 v by damped least squares, so that a stretched leg stays finite.
Vector3 damped_inverse(const Matrix3& j, const Vector3& v) {
  Matrix3 a{};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      a[3 * r + c] = j[3 * r] * j[3 * c] + j[3 * r + 1] * j[3 * c + 1] +
                     j[3 * r + 2] * j[3 * c + 2] + (r == c ? 1e-4 : 0.0);
  const Vector3 r0{a[0], a[1], a[2]}, r1{a[3], a[4], a[5]}, r2{a[6], a[7], a[8]};
  const Vector3 c0 = cross(r1, r2), c1 = cross(r2, r0), c2 = cross(r0, r1);
  const double inverse = 1 / dot(r0, c0);
  return transposed_times(j, inverse * (v[0] * c0 + v[1] * c1 + v[2] * c2));
}

// Rotation vector [rad] from upright along world x to the base's orientation, for moderate angles.
Vector3 tilt(std::span<const double> q) {
  const double s = q[3] < 0 ? -2 : 2;
  return {s * q[4], s * q[5], s * q[6]};
}

}  // namespace

TrotController::TrotController(const TrotOptions& options) : options_(options) {
  stance_.fill(true);
}

void TrotController::reset(std::span<const double> q) {
  stance_.fill(true);
  swing_.fill({});
  lane_ = q[1];
  speed_bias_ = 0;
  time_ = 0;
}

void TrotController::update(double time, std::span<const double> q, std::span<const double> u,
                            std::span<double> torque) {
  std::array<LegState, kNumLegs> legs;
  for (int l = 0; l < kNumLegs; ++l) legs[l] = leg_state(l, q, u);
  plan(time, q, legs);
  const double speed = speed_command(time, u[0]);
  for (int l = 0; l < kNumLegs; ++l)
    if (!stance_[l] && swing_[l].progress < kDecided) swing_[l].to = foothold(l, speed, q, u);
  const std::array<Vector3, kNumLegs> forces = stance_forces(speed, q, u, legs);
  for (int l = 0; l < kNumLegs; ++l) {
    const Vector3 tau =
        stance_[l] ? legs[l].gravity_torque - transposed_times(legs[l].contact_jacobian, forces[l])
                   : swing_torque(l, q, legs[l]);
    for (int k = 0; k < 3; ++k)
      torque[3 * l + k] = std::clamp(tau[k], -options_.torque_limit, options_.torque_limit);
  }
}

// The ramp, and at its end a slow integral that takes out the steady error of the force law.
double TrotController::speed_command(double time, double speed) {
  const double ramp = (time - options_.start) * options_.acceleration;
  const double step = std::clamp(time - time_, 0.0, 0.02);
  time_ = time;
  const double top = std::abs(options_.speed);
  if (ramp > top)
    speed_bias_ = std::clamp(speed_bias_ + 0.5 * step * (options_.speed - speed), -0.4, 0.4);
  return std::copysign(std::clamp(ramp, 0.0, top), options_.speed) + speed_bias_;
}

// Which legs swing now, and how far they are.
void TrotController::plan(double time, std::span<const double> q,
                          const std::array<LegState, kNumLegs>& legs) {
  const double clock = (time - options_.start) / options_.period;
  for (int l = 0; l < kNumLegs; ++l) {
    const double turns = clock + (l == 0 || l == 3 ? 0.0 : 0.5);  // LF, RH against LH, RF
    const double phase = turns - std::floor(turns);
    const bool swings = clock >= 0 && phase < options_.swing_fraction;
    Swing& swing = swing_[l];
    const Vector3 foot = legs[l].foot + Vector3{q[0], q[1], q[2]};
    if (!swings) swing.landed = false;
    if (stance_[l] && swings && !swing.landed) {
      stance_[l] = false;
      swing.from = foot;
    }
    if (stance_[l]) continue;
    swing.progress = swings ? phase / options_.swing_fraction : 1;
    if (swing.progress > 0.6 && foot[2] - kFootRadius - options_.ground < kTouch) {
      stance_[l] = true;
      swing.landed = swings;
    }
  }
}

double TrotController::lateral_command(std::span<const double> q) const {
  return std::clamp(0.5 * (lane_ - q[1]), -0.15, 0.15);
}

std::array<Vector3, kNumLegs> TrotController::stance_forces(
    double speed, std::span<const double> q, std::span<const double> u,
    const std::array<LegState, kNumLegs>& legs) const {
  const Matrix3 base = rotation_of(q.subspan(3).first<4>());
  const Vector3 center = base * kCenter, spin{u[3], u[4], u[5]}, lean = tilt(q);
  const Vector3 velocity = Vector3{u[0], u[1], u[2]} + cross(spin, center);

  // wrench about the center of mass
  double b[6];
  b[0] = std::clamp(8 * (speed - velocity[0]), -4.0, 4.0);
  b[1] = std::clamp(8 * (lateral_command(q) - velocity[1]), -4.0, 4.0);
  b[2] = kGravity + std::clamp(150 * (options_.ground + options_.height - q[2]) - 20 * velocity[2],
                               -8.0, 12.0);
  for (int i = 0; i < 3; ++i) b[i] *= kTotalMass;
  constexpr Vector3 kStiffness{200, 200, 60}, kDamping{26, 26, 14};
  for (int i = 0; i < 3; ++i)
    b[3 + i] =
        kInertia[i] * std::clamp(-kStiffness[i] * lean[i] - kDamping[i] * spin[i], -60.0, 60.0);

  // A A' + eps S^-1; A has the blocks 1 and [r]x
  Vector3 arm[kNumLegs];
  double a[6][6] = {};
  for (int i = 0; i < 6; ++i) a[i][i] = i < 3 ? 1e-3 : 1e-5;  // level before speed
  for (int l = 0; l < kNumLegs; ++l) {
    if (!stance_[l]) continue;
    const Vector3 r = arm[l] = legs[l].foot - Vector3{0, 0, kFootRadius} - center;
    const double x[3][3] = {{0, -r[2], r[1]}, {r[2], 0, -r[0]}, {-r[1], r[0], 0}};
    for (int i = 0; i < 3; ++i) {
      a[i][i] += 1;
      for (int j = 0; j < 3; ++j) {
        a[3 + i][j] += x[i][j];
        for (int k = 0; k < 3; ++k) a[3 + i][3 + j] += x[i][k] * x[j][k];
      }
    }
  }
  solve6(a, b);

  const Vector3 force{b[0], b[1], b[2]}, moment{b[3], b[4], b[5]};
  std::array<Vector3, kNumLegs> forces{};
  for (int l = 0; l < kNumLegs; ++l) {
    if (!stance_[l]) continue;
    Vector3 f = force + cross(moment, arm[l]);  // A' x
    f[2] = std::clamp(f[2], 15.0, 600.0);
    const double tangential = std::sqrt(f[0] * f[0] + f[1] * f[1]);
    const double scale = std::min(1.0, options_.friction * f[2] / std::max(tangential, 1e-9));
    forces[l] = {scale * f[0], scale * f[1], f[2]};
  }
  return forces;
}

// Under the hip at touch-down, ahead by half a stance, shifted against the speed error.
Vector3 TrotController::foothold(int leg, double speed, std::span<const double> q,
                                 std::span<const double> u) const {
  const TrotOptions& o = options_;
  const double swing_time = o.swing_fraction * o.period, stance_time = o.period - swing_time;
  const double time_left = (1 - swing_[leg].progress) * swing_time;
  const double fore = leg == 1 || leg == 3 ? -1 : 1, left = leg >= 2 ? -1 : 1;
  const Matrix3 base = rotation_of(q.subspan(3).first<4>());
  const double heading = 1 / std::sqrt(base[0] * base[0] + base[3] * base[3]);
  const double ahead = fore * o.foothold_x, aside = left * o.foothold_y;
  const double command[2] = {speed, lateral_command(q)};
  Vector3 to{heading * (base[0] * ahead - base[3] * aside),
             heading * (base[3] * ahead + base[0] * aside), o.ground + kFootRadius};
  for (int i = 0; i < 2; ++i)
    to[i] += q[i] + u[i] * (time_left + stance_time / 2) + o.foothold_gain * (u[i] - command[i]);
  return to;
}

Vector3 TrotController::swing_torque(int leg, std::span<const double> q,
                                     const LegState& state) const {
  const TrotOptions& o = options_;
  const Swing& swing = swing_[leg];
  const double s = swing.progress, swing_time = o.swing_fraction * o.period;

  // path: rest to rest in s for the ground track (10 s^3 - 15 s^4 + 6 s^5), a bump 64 s^3 (1 - s)^3
  // in height
  const double r = 1 - s, rate = 1 / swing_time;
  const double track = s * s * s * (10 + s * (-15 + 6 * s));
  const double track_rate = 30 * s * s * r * r * rate;
  const double track_acceleration = 60 * s * r * (1 - 2 * s) * rate * rate;
  const double bump = 64 * s * s * s * r * r * r;
  const double bump_rate = 192 * s * s * r * r * (1 - 2 * s) * rate;
  const double bump_acceleration = 384 * s * r * (1 + s * (-5 + 5 * s)) * rate * rate;
  const Vector3 way = swing.to - swing.from;
  Vector3 position = swing.from + track * way, velocity = track_rate * way,
          acceleration = track_acceleration * way;
  position[2] += o.clearance * bump;
  velocity[2] += o.clearance * bump_rate;
  acceleration[2] += o.clearance * bump_acceleration;
  const Vector3 foot = state.foot + Vector3{q[0], q[1], q[2]};
  if (s >= 1) {  // late: go straight down until the ground is met
    position[2] = foot[2];
    velocity[2] = -0.3;
  }

  constexpr double kStiffness = 2500,
                   kDamping = 100;  // [1/s^2], [1/s]: critically damped at 50 rad/s
  const Vector3 wanted =
      acceleration + kStiffness * (position - foot) + kDamping * (velocity - state.foot_velocity);
  return state.inertia * damped_inverse(state.foot_jacobian, wanted) + state.gravity_torque;
}

}  // namespace stickslip::scenes
