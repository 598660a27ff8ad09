#include "scenes/tasks.h"

#include <stickslip/errors.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "lane/math.h"
#include "scenes/normal.h"

namespace stickslip::scenes {
namespace {

// clang-format off
constexpr TaskSpec kSpecs[] = {
    // kind                 name               torso  kp   kd episode height speed moving ends
    {TaskKind::kTrot,         "trot",            true,    0, 0, 100, 0.5, 0, false, false},
    {TaskKind::kHang,         "hang",            false,   0, 0,  20, 1.0, 0, false, false},
    {TaskKind::kDrop,         "drop",            true,    0, 0,   5, 1.0, 1, false, true},
    {TaskKind::kRandom,       "random",          true,   40, 4,   5, 1.0, 0, true,  false},
    {TaskKind::kStand,        "stand",           true,  200, 5,   5, 0.5, 0, false, false},
    {TaskKind::kOpenLoopTrot, "open_loop_trot",  true,  200, 5,   5, 0.5, 0, true,  false},
};
// clang-format on

constexpr double kHold = 0.01;                // between PD targets [s]
constexpr double kStill = 0.05;               // [m/s, rad/s]
constexpr double kStillTime = 0.2;            // [s]
constexpr std::uint64_t kEpisodeBase = 5000;  // random numbers set aside per episode

// Random number i (12: one per joint) of the order LF RF LH RH that fixes the tasks, for joint j.
int peer_index(int j) { return 3 * kPeerLeg[j / 3] + j % 3; }

}  // namespace

std::span<const TaskSpec> task_specs() { return kSpecs; }

const TaskSpec& task_spec(TaskKind kind) {
  return *std::find_if(std::begin(kSpecs), std::end(kSpecs),
                       [&](const TaskSpec& s) { return s.kind == kind; });
}

const TaskSpec& task_spec(const std::string& name) {
  std::string names;
  for (const TaskSpec& s : kSpecs) {
    if (name == s.name) return s;
    names += std::string(names.empty() ? "" : ", ") + s.name;
  }
  throw ModelError("task: there is no task '" + name + "'; the tasks are " + names);
}

ModelPtr task_model(TaskKind kind, const ModelPtr& anymal) {
  return task_spec(kind).collide_torso ? anymal : without_base_shapes(*anymal);
}

void initial_state(TaskKind kind, int episode, std::span<double> q, std::span<double> u) {
  const TaskSpec& spec = task_spec(kind);
  const std::uint64_t first = kEpisodeBase * static_cast<std::uint64_t>(episode);
  std::fill(q.begin(), q.end(), 0.0);
  std::fill(u.begin(), u.end(), 0.0);
  q[2] = spec.height;
  u[0] = spec.speed;
  const double spread = kind == TaskKind::kDrop                                ? 0.1
                        : kind == TaskKind::kHang || kind == TaskKind::kRandom ? 0.05
                                                                               : 0;
  for (int j = 0; j < kNumJoints; ++j)
    q[7 + j] = kStance[j] + (spread > 0 ? spread * normal(first + peer_index(j)) : 0);
  double roll = 0, pitch = 0;
  if (kind == TaskKind::kDrop) {
    roll = 0.3 * normal(first + 12);
    pitch = 0.3 * normal(first + 13);
  }
  double sr, cr, sp, cp;  // R = Ry(pitch) Rx(roll)
  sincos(roll / 2, sr, cr);
  sincos(pitch / 2, sp, cp);
  q[3] = cp * cr;
  q[4] = cp * sr;
  q[5] = sp * cr;
  q[6] = -sp * sr;
}

int target_tick(long step, double time_step) {
  return static_cast<int>(std::floor(step * time_step / kHold + 1e-6));
}

void pd_target(TaskKind kind, int episode, int tick, std::span<double> target) {
  std::copy(kStance.begin(), kStance.end(), target.begin());
  if (kind == TaskKind::kRandom) {
    // new targets every second tick, 20 ms
    const std::uint64_t first =
        kEpisodeBase * static_cast<std::uint64_t>(episode) + 100 + 12 * (tick / 2);
    for (int j = 0; j < kNumJoints; ++j) target[j] += normal(first + peer_index(j));
  }
  if (kind == TaskKind::kOpenLoopTrot) {
    double sine, cosine;
    sincos(2 * 3.14159265358979323846 * 2.0 * tick * kHold, sine, cosine);
    for (int l = 0; l < kNumLegs; ++l) {
      const double side = l == 0 || l == 3 ? 1 : -1;  // LF, RH against LH, RF
      const double fore = l == 0 || l == 2 ? 1 : -1, lift = std::max(0.0, side * cosine);
      target[3 * l + 1] += -0.15 * side * sine + fore * 0.25 * lift;
      target[3 * l + 2] -= fore * 0.5 * lift;
    }
  }
}

Task::Task(TaskKind kind, double time_step) : spec_(&task_spec(kind)), time_step_(time_step) {}

void Task::reset(Robot& robot, int episode) {
  std::array<double, 7 + kNumJoints> q;
  std::array<double, 6 + kNumJoints> u;
  initial_state(spec_->kind, episode, q, u);
  robot.set_state(q, u);
  std::array<double, kNumJoints> gain;
  std::array<double, kNumJoints> damping;
  gain.fill(spec_->kp);
  damping.fill(spec_->kd);
  robot.set_pd_gains(gain, damping);
  u.fill(0);
  robot.set_generalized_force(u);
  episode_ = episode;
  step_ = 0;
  still_ = 0;
  tick_ = -1;
  controller_.reset(q);
  std::array<double, kNumJoints> target;
  pd_target(spec_->kind, episode, 0, target);
  robot.set_pd_target(target);
}

void Task::before_step(Robot& robot) {
  if (spec_->kind == TaskKind::kTrot) {
    std::array<double, 6 + kNumJoints> force{};
    controller_.update(time(), robot.q(), robot.u(), std::span<double>(force).subspan(6));
    robot.set_generalized_force(force);
  }
  if (!spec_->moving_targets) return;
  const int tick = target_tick(step_, time_step_);
  if (tick == tick_) return;
  tick_ = tick;
  std::array<double, kNumJoints> target;
  pd_target(spec_->kind, episode_, tick, target);
  robot.set_pd_target(target);
}

bool Task::after_step(const Robot& robot) {
  ++step_;
  if (spec_->ends_when_still) {
    double fastest = 0;
    for (const double rate : robot.u()) fastest = std::max(fastest, std::abs(rate));
    still_ = fastest < kStill ? still_ + time_step_ : 0;
    if (still_ > kStillTime) return true;
  }
  return step_ >= std::lround(spec_->episode / time_step_);
}

bool Task::advance(World& world, Robot& robot) {
  before_step(robot);
  world.step();
  const bool over = after_step(robot);
  if (over) reset(robot, episode_ + 1);
  return over;
}

}  // namespace stickslip::scenes
