// Times the engines on a scenario, in turns, and then watches the same runs.
#pragma once
#include "benchmarks/compare/observer.h"

namespace stickslip::benchmarks {

struct Settings {
  long steps = 20'000;  ///< per repetition
  int repetitions = 7;  ///< counted; one more warms up
  std::vector<std::string> engines{"semi_implicit", "energy_safe", "mujoco"};
  bool statistics = true;
};

struct Measurement {
  std::string engine;
  std::vector<double> microseconds;  ///< per step, one per repetition
  Findings findings;
  std::vector<std::string> faults;  ///< why the result does not count; empty: it does
};

struct ScenarioResult {
  const Scenario* scenario;
  double disagreement = 0;  ///< of the models, see model_disagreement
  double core_share = 1;    ///< share of the wall clock that this thread had the core
  std::vector<Measurement> engines;

  const Measurement* find(const std::string& engine) const;
  /// MuJoCo's time over an engine's: median over the repetitions of the ratio of the two runs that
  /// followed each other. 0 where either was not run.
  double ratio(const std::string& engine) const;
};

double median(std::vector<double> values);

ScenarioResult measure(const Scenario& scenario, const Settings& settings);

}  // namespace stickslip::benchmarks
