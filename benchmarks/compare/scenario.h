// One benchmark task for any engine: what an episode does, as pure functions of (episode, step).
#pragma once
#include <stickslip/model.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace stickslip::benchmarks {

inline constexpr double kTimeStep = 1e-3;  ///< [s]

struct Scenario {
  std::string name;  ///< as in "STAND"
  ModelPtr model;
  bool ground = true;
  std::vector<double> kp, kd;  ///< per joint [N m/rad], [N m s/rad]; all zero: unactuated
  long episode_steps = 5000;
  long hold_steps = 0;  ///< steps between PD targets; 0: the first target holds for the episode
  bool ends_when_still = false;  ///< reset when every |u| stayed below 0.05 for 0.2 s
  bool shows_energy = false;     ///< unactuated for a whole episode: energy at `settle` and its end
  double settle = 2;  ///< penetration and base height count after so much of an episode [s]

  /// q (nq) and u (nu) at the start of an episode, conventions of Model.
  std::function<void(int episode, std::span<double> q, std::span<double> u)> initial_state;
  /// PD target (joints) number `k` of an episode; 0 is the first.
  std::function<void(int episode, int k, std::span<double> target)> target;

  /// A right result has its mean base height, after `settle`, between these [m].
  double lowest_base = -1e9, highest_base = 1e9;
  /// Ratios to MuJoCo that are aimed at; 0: measured only. aim_batch: float32, semi_implicit,
  /// AVX-512.
  double aim_world = 0, aim_world_energy_safe = 0, aim_batch = 0;
  bool aim_batch_variants = true;  ///< double precision and energy_safe have aims, too
  /// Where not empty: of all tasks with this word one must reach its aims.
  std::string aim_group;

  bool actuated() const;
};

/// STAND, TROT, HANG, DROP, RANDOM with ANYmal B.
std::vector<Scenario> anymal_scenarios(const std::string& urdf);

}  // namespace stickslip::benchmarks
