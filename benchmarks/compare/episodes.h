// The loop of the benchmark, once for every engine: targets, step, resets. The engine is a template
// argument so that no engine pays for a call that another does not pay.
#pragma once
#include <algorithm>
#include <cmath>

#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

/// What changes an episode from outside (targets, resets) comes at multiples of so many steps.
inline constexpr long kTick = 10;
/// A task that ends when still does so when every |u| was below kStill [m/s, rad/s] at more than
/// kStillTicks ticks in a row: 0.2 s.
inline constexpr double kStill = 0.05;
inline constexpr int kStillTicks = 20;

/// Watches nothing: for timing.
struct NoObserver {
  template <class Engine>
  void begin(Engine&) {}
  template <class Engine>
  void after_step(Engine&, long) {}
};

/// Runs `steps` steps from the start of episode `episode`; returns the number of the next episode.
/// An engine has reset(episode), set_target(target), step(), velocities().
template <class Engine, class Observer>
int run_episodes(Engine& engine, const Scenario& s, int episode, long steps, Observer&& observer) {
  std::vector<double> target(s.kp.size());
  long k = 0;
  int still = 0;
  const auto reset = [&] {
    engine.reset(episode);
    s.target(episode, 0, target);
    engine.set_target(target);
    observer.begin(engine);
    k = 0;
    still = 0;
  };
  reset();
  for (long i = 0; i < steps; ++i) {
    if (s.hold_steps && k > 0 && k % s.hold_steps == 0) {
      s.target(episode, static_cast<int>(k / s.hold_steps), target);
      engine.set_target(target);
    }
    engine.step();
    ++k;
    observer.after_step(engine, k);
    bool over = k >= s.episode_steps;
    if (s.ends_when_still && k % kTick == 0) {
      double fastest = 0;
      for (const double rate : engine.velocities()) fastest = std::max(fastest, std::fabs(rate));
      still = fastest < kStill ? still + 1 : 0;
      over = over || still > kStillTicks;
    }
    if (over) {
      ++episode;
      reset();
    }
  }
  return episode + 1;
}

}  // namespace stickslip::benchmarks
