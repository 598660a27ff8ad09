// Neither sinking nor exploding, at 1 to 20 ms (docs/theory/step.md): the default integrator.
#include "scene.h"

using namespace scene;

namespace {

void print(const char* what, double dt, const Statistics& s) {
  std::printf(
      "  %s %2.0f ms: penetration mean %.5f mm, max %.3f mm (landing %.2f mm), velocity max %.0f, "
      "exploded %ld of "
      "%ld, energy growth %.1e J, %.2f substeps, not converged %ld of %ld\n",
      what, 1e3 * dt, 1e3 * s.mean_penetration(), 1e3 * s.max_penetration,
      1e3 * s.max_landing_penetration, s.max_velocity, s.exploded, s.episodes, s.max_energy_growth,
      s.substeps / s.steps, s.not_converged, s.steps);
}

}  // namespace

TEST(HangingFeetDoNotSinkAtAnyStepSize) {
  for (const double dt : {1e-3, 5e-3, 10e-3, 20e-3}) {
    const Statistics s = run_episodes(TaskKind::kHang, options(dt), 20);
    print("hang", dt, s);
    CHECK(s.mean_penetration() < 1e-5);
    CHECK(s.exploded == 0);
  }
}

TEST(HangingAt20MillisecondsNeitherExplodesNorGainsEnergy) {
  const Statistics s = run_episodes(TaskKind::kHang, options(20e-3), 100, true);
  print("hang", 20e-3, s);
  CHECK(s.exploded == 0);
  CHECK(s.max_velocity < 1000);
  CHECK(s.max_energy_growth < 1e-2);
}

TEST(DropAt20MillisecondsNeitherExplodesNorGainsEnergy) {
  const Statistics s = run_episodes(TaskKind::kDrop, options(20e-3), 1000, true);
  print("drop", 20e-3, s);
  CHECK(s.not_converged == 0);  // what the step's own solver leaves, four steps, the chain solves
  CHECK(s.exploded == 0);
  CHECK(s.max_velocity < 1000);
  CHECK(s.max_energy_growth < 1e-2);
}

TEST(DropAtSmallStepsGainsLessThanTenMicrojoules) {
  const Statistics s = run_episodes(TaskKind::kDrop, options(1e-3), 30, true);
  print("drop", 1e-3, s);
  CHECK(s.exploded == 0);
  CHECK(s.max_energy_growth < 1e-5);
}
