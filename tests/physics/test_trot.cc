// Trotting at 1.5 m/s: no fall, right speed, feet that stand while they stand.
#include "scene.h"

using namespace scene;

namespace {

struct Outcome {
  double seconds = 0;  // until the fall, or the end
  double lowest = 1, tilt = 0, yaw = 0, y = 0;
  Statistics statistics;
};

// Trots for `seconds`; `push` [m/s] is added sideways to the base's velocity every 2 s.
Outcome trot(const WorldOptions& o, double seconds, double push = 0) {
  Scene s(TaskKind::kTrot, o);
  Outcome out{.statistics = Statistics(o)};
  out.statistics.begin(s.robot);
  const long steps = std::lround(seconds / o.time_step), every = std::lround(2 / o.time_step);
  double sign = push;
  for (long i = 1; i <= steps; ++i) {
    s.task.before_step(s.robot);
    s.world.step();
    s.task.after_step(s.robot);
    out.statistics.observe(s.robot);
    const auto q = s.robot.q();
    out.seconds = i * o.time_step;
    out.lowest = std::min(out.lowest, q[2]);
    out.tilt = std::max(out.tilt, 2 * std::hypot(q[4], q[5]));  // sin of the lean, nearly
    out.yaw = std::max(out.yaw, 2 * std::fabs(q[6]));
    out.y = std::max(out.y, std::fabs(q[1]));
    if (!(q[2] > 0.3) || out.tilt > 0.8) break;
    if (push != 0 && i % every == 0) {
      std::vector<double> position(q.begin(), q.end());
      std::vector<double> velocity(s.robot.u().begin(), s.robot.u().end());
      velocity[1] += sign;
      sign = -sign;
      s.robot.set_state(position, velocity);
    }
  }
  std::printf(
      "  %.1f s, %.2f m, %.3f m/s, slip %.3f %%, height over %.3f m, tilt %.3f, yaw %.3f, aside "
      "%.3f m, "
      "max residual %.1e m/s, not converged %ld, penetration %.2g mm\n",
      out.seconds, out.statistics.distance, out.statistics.distance / out.seconds,
      100 * out.statistics.slip / out.statistics.distance, out.lowest, out.tilt, out.yaw, out.y,
      out.statistics.max_residual, out.statistics.not_converged,
      1e3 * out.statistics.max_penetration);
  return out;
}

void check_good(const Outcome& out, double seconds, double slip) {
  CHECK_NEAR(out.seconds, seconds, 1e-9);
  CHECK(out.lowest > 0.42);
  CHECK(out.tilt < 0.2);
  CHECK(out.yaw < 0.1);
  CHECK(out.y < 0.3);
  CHECK(out.statistics.slip < slip * out.statistics.distance);
}

}  // namespace

TEST(TrotKeepsRunningFor100SecondsAtItsSpeedWithoutSlipping) {
  const Outcome out = trot(options(1e-3), 100);
  check_good(out, 100, 0.003);  // asked for: 1 %
  CHECK_NEAR(out.statistics.distance / 100, 1.5, 0.1);
}

TEST(TrotRunsOnThePapersIntegratorToo) {
  const Outcome out = trot(options(1e-3, Integrator::kSemiImplicit), 20);
  check_good(out, 20, 0.003);
}

TEST(TrotRunsAtLargerSteps) { check_good(trot(options(4e-3), 20), 20, 0.003); }

TEST(TrotSurvivesSidewaysPushes) {
  const Outcome out = trot(options(1e-3), 20, 0.3);
  CHECK_NEAR(out.seconds, 20, 1e-9);
}
