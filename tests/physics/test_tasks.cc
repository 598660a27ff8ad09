// The tasks start, reset and end as they say, and repeat to the bit.
#include <stickslip/errors.h>

#include <cstring>

#include "scene.h"
#include "scenes/normal.h"

using namespace scene;

namespace {

// Steps a task, resets included, and hashes every state (FNV-1a).
std::uint64_t run_hash(TaskKind kind, int steps) {
  Scene s(kind, options(1e-3));
  std::uint64_t hash = 14695981039346656037ull;
  const auto add = [&](std::span<const double> values) {
    for (const double v : values) {
      std::uint64_t bits;
      std::memcpy(&bits, &v, 8);
      hash = (hash ^ bits) * 1099511628211ull;
    }
  };
  for (int i = 0; i < steps; ++i) {
    s.task.advance(s.world, s.robot);
    add(s.robot.q());
    add(s.robot.u());
  }
  return hash;
}

}  // namespace

TEST(EveryTaskRepeatsToTheBit) {
  for (const TaskSpec& spec : task_specs()) {
    const std::uint64_t hash = run_hash(spec.kind, 1500);
    CHECK(hash == run_hash(spec.kind, 1500));
  }
}

TEST(EveryTaskStaysFiniteAndReportsItsEpisodes) {
  for (const TaskSpec& spec : task_specs()) {
    if (spec.kind == TaskKind::kTrot) continue;  // test_trot
    const Statistics s = run_episodes(spec.kind, options(1e-3), 2);
    CHECK(s.exploded == 0);
    CHECK(s.episodes == 2);
    CHECK(s.steps <= std::lround(2 * spec.episode / 1e-3));
    if (!spec.ends_when_still) CHECK(s.steps == std::lround(2 * spec.episode / 1e-3));
    std::printf(
        "  %s: %.2f contacts, penetration mean %.4f mm, max velocity %.1f, max residual %.1e m/s, "
        "not converged %ld of %ld\n",
        spec.name, s.contacts / s.steps, 1e3 * s.mean_penetration(), s.max_velocity, s.max_residual,
        s.not_converged, s.steps);
  }
}

// Joints without friction swing on for long, so most episodes last their 5 s; those that end sooner
// end still.
TEST(DropEndsWhenMotionDies) {
  const WorldOptions o = options(5e-3);
  Scene s(TaskKind::kDrop, o);
  int early = 0;
  for (int e = 0; e < 100; ++e) {
    s.task.reset(s.robot, e);
    bool over = false;
    while (!over) {
      s.task.before_step(s.robot);
      s.world.step();
      over = s.task.after_step(s.robot);
    }
    if (s.task.time() > 5 - 1e-9) continue;
    ++early;
    for (const double rate : s.robot.u()) CHECK(std::fabs(rate) < 0.05);
  }
  std::printf("  %d of 100 episodes end before 5 s\n", early);
  CHECK(early > 0);
}

TEST(EpisodesDifferAndStartAsTheySay) {
  double q0[19], q1[19], u[18];
  initial_state(TaskKind::kDrop, 0, q0, u);
  initial_state(TaskKind::kDrop, 1, q1, u);
  CHECK(std::memcmp(q0, q1, sizeof q0) != 0);
  CHECK_NEAR(u[0], 1, 0);
  CHECK_NEAR(q0[2], 1, 0);
  CHECK_NEAR(q0[3] * q0[3] + q0[4] * q0[4] + q0[5] * q0[5] + q0[6] * q0[6], 1, 1e-15);
  initial_state(TaskKind::kHang, 3, q0, u);
  for (int i = 0; i < 18; ++i) CHECK(u[i] == 0);
  initial_state(TaskKind::kStand, 7, q0, u);
  for (int j = 0; j < 12; ++j) CHECK(q0[7 + j] == kStance[j]);
}

TEST(RandomTargetsHaveUnitVarianceAndHoldFor20Milliseconds) {
  double sum = 0, square = 0, target[12], next[12];
  const int ticks = 4000;
  for (int k = 0; k < ticks; k += 2) {
    pd_target(TaskKind::kRandom, k / 500, k % 500, target);
    pd_target(TaskKind::kRandom, k / 500, k % 500 + 1, next);
    CHECK(std::memcmp(target, next, sizeof target) == 0);
    for (int j = 0; j < 12; ++j) {
      const double x = target[j] - kStance[j];
      sum += x;
      square += x * x;
    }
  }
  const int n = 12 * ticks / 2;  // 24000: standard error of the variance 0.009
  CHECK_NEAR(sum / n, 0, 0.03);
  CHECK_NEAR(square / n, 1, 0.04);
  CHECK(target_tick(19, 1e-3) == 1);
  CHECK(target_tick(20, 1e-3) == 2);
  CHECK(target_tick(1, 0.02) == 2);
}

TEST(NormalNumbersHaveTheMomentsOfTheNormalDistribution) {
  double m1 = 0, m2 = 0, m4 = 0, neighbors = 0, last = 0;
  const int n = 1 << 20;
  for (int k = 0; k < n; ++k) {
    const double x = normal(k);
    m1 += x / n;
    m2 += x * x / n;
    m4 += x * x * x * x / n;
    neighbors += x * last / n;
    last = x;
  }
  CHECK_NEAR(m1, 0, 4e-3);
  CHECK_NEAR(m2, 1, 6e-3);
  CHECK_NEAR(m4, 3, 4e-2);
  CHECK_NEAR(neighbors, 0, 4e-3);
}

TEST(HangingRobotIsTheSameButForTheTorsoShape) {
  const ModelPtr feet = task_model(TaskKind::kHang, anymal());
  CHECK(task_model(TaskKind::kDrop, anymal()) == anymal());
  CHECK(anymal()->shapes().size() == 5);
  CHECK(feet->shapes().size() == 4);
  for (const Shape& shape : feet->shapes()) CHECK(shape.body != 0);
  CHECK(feet->frames().size() == anymal()->frames().size());
  CHECK_NEAR(feet->mass(), anymal()->mass(), 1e-12);
  CHECK(feet->num_joints() == 12);
  for (int j = 0; j < 12; ++j) CHECK(feet->joints()[j].name == anymal()->joints()[j].name);
  CHECK_NEAR(feet->frame("LF_FOOT").pose.position[2], anymal()->frame("LF_FOOT").pose.position[2],
             1e-15);
}

TEST(ControllerKnowsTheFeetOfTheModel) {
  World world(options(1e-3));
  Robot& robot = world.add_robot(anymal());
  double q[19], u[18] = {};
  initial_state(TaskKind::kDrop, 5, q, u);
  robot.set_state(q, u);
  const char* names[] = {"LF_FOOT", "LH_FOOT", "RF_FOOT", "RH_FOOT"};
  for (int l = 0; l < 4; ++l) {
    const LegState leg = leg_state(l, q, u);
    // the sphere sits 23.25 mm above the foot frame's origin
    const Pose pose = robot.frame_pose(names[l]);
    for (int i = 0; i < 3; ++i)
      CHECK_NEAR(leg.foot[i] + q[i], pose.position[i] + 0.02325 * pose.rotation[3 * i + 2], 2e-4);
  }
}

TEST(UnknownTaskNamesAreRefusedWithTheList) {
  CHECK_THROWS(task_spec("swim"), ModelError, "trot, hang, drop, random");
}
