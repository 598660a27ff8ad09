// What a run showed, gathered outside the timed loop and by the same rules for every engine.
#pragma once
#include <stickslip/world.h>

#include <cstdint>
#include <memory>
#include <optional>

#include "benchmarks/compare/residuals.h"
#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

/// One engine's state after a step, in the conventions of Model.
struct Snapshot {
  static constexpr double kLeastForce = 1e-3;  ///< a contact pushes from here on [N]
  std::vector<double> q, u;
  int contacts = 0;      ///< in the solve
  int pushing = 0;       ///< with a normal force above kLeastForce
  int iterations = 0;    ///< of the contact solver
  double residual = 0;   ///< of stickslip's solve [m/s]
  bool flagged = false;  ///< the engine said that the solve did not converge
  bool failed = false;   ///< the engine reported a bad state
  double energy = 0;     ///< kinetic and potential, where the scenario shows it [J]
};

/// Means and extremes over all sampled steps.
struct Findings {
  long steps = 0, episodes = 0;                      ///< sampled steps
  double contacts = 0, pushing = 0, iterations = 0;  ///< means per step
  double mean_penetration = 0;  ///< of shapes of moving links that touch, after settling [m]
  double max_penetration = 0;   ///< the same [m]
  double base_height = 0;       ///< mean, after settling [m]
  Residuals residuals;          ///< of every step, also of those between samples
  Residuals second_opinion;     ///< the same of sampled steps, judged from outside
  long other_contacts = 0;      ///< sampled steps for which there is none
  double max_velocity = 0;      ///< [m/s, rad/s]
  long exploded = 0;            ///< steps with a velocity above 1000 or not finite
  long failed = 0;              ///< steps in which the engine reported a bad state
  double energy_settled = 0, energy_at_end = 0;  ///< means over episodes [J]
};

/// Collects Findings from an engine that has observe(Snapshot&).
class Observer {
 public:
  /// tolerance: on residuals [m/s].
  Observer(const Scenario& scenario, double tolerance);

  template <class Engine>
  void begin(Engine&) {
    ++found_.episodes;
  }
  template <class Engine>
  void after_step(Engine& engine, long step_of_episode) {
    sample(engine, step_of_episode);
    add_solve(snapshot_.residual, snapshot_.flagged, snapshot_.failed);
  }
  /// The two parts of it: what every step tells, and the state, for every so many steps.
  void add_solve(double residual, bool flagged, bool failed) {
    found_.residuals.add(residual, flagged);
    found_.failed += failed;
  }
  void add_second_opinion(std::optional<double> residual, bool flagged) {
    if (residual)
      found_.second_opinion.add(*residual, flagged);
    else
      ++found_.other_contacts;
  }
  template <class Engine>
  void sample(Engine&& engine, long step_of_episode) {
    engine.observe(snapshot_);
    add(step_of_episode);
  }
  Findings finish() const;

 private:
  void add(long step_of_episode);
  void measure_penetration();

  const Scenario* scenario_;
  std::unique_ptr<World> ruler_;
  std::vector<std::string> frames_;  // body frames of the shapes on moving links
  std::vector<const Shape*> shapes_;
  Snapshot snapshot_;
  Findings found_;
  long settled_steps_ = 0, touching_ = 0, energies_settled_ = 0, energies_end_ = 0;
};

/// Height of the lowest point of a shape above z = 0 [m]; 1e9 for a mesh.
double lowest_point(const Shape& shape, const Pose& body);

/// Mixes the bits of values into a hash (FNV-1a).
std::uint64_t hash_of(std::span<const double> values, std::uint64_t seed = 14695981039346656037ull);

}  // namespace stickslip::benchmarks
