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

/// Where one robot is in its episodes.
struct EpisodeClock {
  int episode = 0;
  long age = 0;   ///< steps since the episode began
  long end = 0;   ///< its length; 0: it has not begun
  int still = 0;  ///< ticks for which every velocity was small

  bool over() const { return age >= end || still > kStillTicks; }
};

/// Takes `steps` steps from where `clock` is, which moves on; one that is over goes on with the
/// next episode. An engine has reset(episode), set_target(target), step(), velocities().
template <class Engine, class Observer>
void run_episodes(Engine& engine, const Scenario& s, EpisodeClock& clock, long steps,
                  Observer&& observer) {
  std::vector<double> target(s.kp.size());
  const auto set_target = [&](long phase) {
    s.target(clock.episode, static_cast<int>(phase), target);
    engine.set_target(target);
  };
  for (long i = 0; i < steps; ++i) {
    if (clock.over()) {
      clock = {clock.episode + 1, 0, s.episode_steps, 0};
      engine.reset(clock.episode);
      set_target(0);
      observer.begin(engine);
    } else if (s.hold_steps && clock.age % s.hold_steps == 0) {
      set_target(clock.age / s.hold_steps);
    }
    engine.step();
    ++clock.age;
    observer.after_step(engine, clock.age);
    if (s.ends_when_still && clock.age % kTick == 0) {
      double fastest = 0;
      for (const double rate : engine.velocities()) fastest = std::max(fastest, std::fabs(rate));
      clock.still = fastest < kStill ? clock.still + 1 : 0;
    }
  }
}

}  // namespace stickslip::benchmarks
