#include "benchmarks/compare/scenario.h"

#include <algorithm>
#include <cmath>

#include "scenes/tasks.h"

namespace stickslip::benchmarks {

using scenes::TaskKind;

bool Scenario::actuated() const {
  const auto positive = [](double gain) { return gain > 0; };
  return std::any_of(kp.begin(), kp.end(), positive) || std::any_of(kd.begin(), kd.end(), positive);
}

std::vector<Scenario> anymal_scenarios(const std::string& urdf) {
  struct Row {
    const char* name;
    TaskKind kind;
    double lowest_base, highest_base, world, world_energy_safe, batch;
  };
  // HANG: only the feet collide, so the base hangs below the ground that the feet stand on.
  constexpr Row kRows[] = {
      {"STAND", TaskKind::kStand, 0.42, 0.52, 7, 2.5, 50},
      {"TROT", TaskKind::kOpenLoopTrot, 0.35, 0.55, 7, 2.5, 40},
      {"HANG", TaskKind::kHang, -0.65, -0.25, 5, 2.5, 28},
      {"DROP", TaskKind::kDrop, 0.03, 0.45, 5, 2.5, 25},
      {"RANDOM", TaskKind::kRandom, 0.1, 1.0, 7, 2.5, 30},
  };
  const ModelPtr anymal = load_urdf(urdf);
  std::vector<Scenario> out;
  for (const Row& row : kRows) {
    const scenes::TaskSpec& spec = scenes::task_spec(row.kind);
    Scenario s;
    s.name = row.name;
    s.model = scenes::task_model(row.kind, anymal);
    s.kp.assign(anymal->num_joints(), spec.kp);
    s.kd.assign(anymal->num_joints(), spec.kd);
    s.episode_steps = std::lround(spec.episode / kTimeStep);
    s.hold_steps = spec.moving_targets ? 10 : 0;  // scenes' targets change every 10 ms
    s.ends_when_still = spec.ends_when_still;
    s.shows_energy = row.kind == TaskKind::kHang;
    s.initial_state = [kind = row.kind](int episode, std::span<double> q, std::span<double> u) {
      scenes::initial_state(kind, episode, q, u);
    };
    s.target = [kind = row.kind](int episode, int k, std::span<double> target) {
      scenes::pd_target(kind, episode, k, target);
    };
    s.lowest_base = row.lowest_base;
    s.highest_base = row.highest_base;
    s.aim_world = row.world;
    s.aim_world_energy_safe = row.world_energy_safe;
    s.aim_batch = row.batch;
    out.push_back(std::move(s));
  }
  return out;
}

}  // namespace stickslip::benchmarks
