// Times the engines on a scenario, in turns, and then watches the same runs.
#pragma once
#include <cmath>

#include "benchmarks/compare/runner.h"

namespace stickslip::benchmarks {

struct Measurement {
  EngineChoice engine;
  int robots = 1;
  long robot_steps = 0;              ///< timed in a repetition
  std::string instruction_set;       ///< of a batch
  std::vector<double> microseconds;  ///< per robot-step, one per repetition
  std::uint64_t hash = 0;            ///< over the velocities that the repetitions ended with
  Findings findings;
  bool watched = false;             ///< findings are those of these repetitions
  std::vector<std::string> faults;  ///< why the result does not count; empty: it does

  /// Mean over the repetitions: an episode has costly and cheap phases. Of wall time, which knows
  /// interruptions, the median.
  double microseconds_per_step() const;
};

struct ScenarioResult {
  const Scenario* scenario;
  double disagreement = 0;  ///< of the models, see model_disagreement
  double core_share = NAN;  ///< share of the wall clock that engines timed by it had a core
  std::vector<Measurement> engines;

  const Measurement* find(const std::string& engine) const;
  Aim aim(const Measurement& m) const { return aim_of(m.engine, *scenario, m.instruction_set); }
  /// The time per robot-step of the engine that m is compared with over m's; of wall times the
  /// median over the repetitions. 0 where there is none.
  double ratio(const Measurement& m) const;
  bool misses_aim(const Measurement& m) const;
};

ScenarioResult measure(const Scenario& scenario, const Settings& settings);

}  // namespace stickslip::benchmarks
