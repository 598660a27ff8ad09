// stickslip as an engine of the benchmark.
#pragma once
#include <stickslip/world.h>

#include "benchmarks/compare/episodes.h"
#include "benchmarks/compare/observer.h"

namespace stickslip::benchmarks {

/// The robot on its ground, with its gains.
World make_world(const Scenario& scenario, Integrator integrator);

class StickslipEngine {
 public:
  StickslipEngine(const Scenario& scenario, Integrator integrator);

  void reset(int episode);
  void set_target(std::span<const double> target) { robot_->set_pd_target(target); }
  void step() { world_.step(); }
  std::span<const double> velocities() const { return robot_->u(); }

  /// State and contacts after a step, for the observer.
  void observe(Snapshot& out) const;

 private:
  const Scenario* scenario_;
  World world_;
  Robot* robot_;
  std::vector<double> q_, u_;
};

}  // namespace stickslip::benchmarks
