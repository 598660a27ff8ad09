#include "benchmarks/compare/runner.h"

#include <optional>

#include "benchmarks/compare/batch_loop.h"
#include "benchmarks/compare/cores.h"
#include "benchmarks/compare/mujoco_loop.h"
#include "benchmarks/compare/stickslip_loop.h"

namespace stickslip::benchmarks {
namespace {

/// One robot.
template <class Engine>
class SingleRunner : public Runner {
 public:
  template <class... More>
  SingleRunner(const Scenario& s, long steps, More... more)
      : engine_(s, more...), scenario_(&s), steps_(steps) {}

  void run() override { run_episodes(engine_, *scenario_, clock_, steps_, NoObserver{}); }
  /// At the beginning of the next episode.
  void mark() override { mark_ = clock_ = {clock_.episode}; }
  void rewind() override { clock_ = mark_; }
  void watch(Observer& observer) override {
    run_episodes(engine_, *scenario_, clock_, steps_, observer);
  }
  std::uint64_t hash(std::uint64_t seed) const override {
    return hash_of(engine_.velocities(), seed);
  }
  long robot_steps() const override { return steps_; }

 private:
  Engine engine_;
  const Scenario* scenario_;
  long steps_;
  EpisodeClock clock_, mark_;
};

template <class T>
class BatchRunner : public Runner {
 public:
  BatchRunner(const EngineChoice& choice, const Scenario& s, const Settings& settings)
      : threads_(choice.threads),
        robots_(settings.robots * (choice.wall_clock() ? Settings::kLargeBatch : 1)),
        steps_(std::max(kTick, settings.steps * Settings::work(choice) / robots_ / kTick * kTick)) {
    const auto cores = all_cores();  // its threads inherit them
    engine_.emplace(s, choice, robots_);
  }

  void prepare() override { engine_->prepare(steps_); }
  void run() override {
    const auto cores = all_cores();
    const auto turns = threads_ == 1 ? std::make_unique<TakeTurns>() : nullptr;
    NoObserver nobody;
    engine_->run(steps_, nobody);
  }
  void mark() override { engine_->mark(); }
  void rewind() override { engine_->rewind(); }
  void watch(Observer& observer) override {
    const auto cores = all_cores();
    engine_->prepare(steps_);
    engine_->run(steps_, observer);
  }
  std::uint64_t hash(std::uint64_t seed) const override { return engine_->hash(seed); }
  long robot_steps() const override { return steps_ * robots_; }
  int robots() const override { return robots_; }
  std::string instruction_set() const override { return engine_->batch().instruction_set(); }

 private:
  std::unique_ptr<UseAllCores> all_cores() const {
    return threads_ > 1 ? std::make_unique<UseAllCores>() : nullptr;
  }

  int threads_;  // 0: one, on the core of everybody else
  int robots_;
  long steps_;
  std::optional<BatchEngine<T>> engine_;
};

}  // namespace

std::unique_ptr<Runner> make_runner(const EngineChoice& e, const Scenario& s,
                                    const Settings& settings) {
  switch (e.kind) {
    case EngineKind::kMujoco:
      return std::make_unique<SingleRunner<MujocoEngine>>(s, settings.steps);
    case EngineKind::kWorld:
      return std::make_unique<SingleRunner<StickslipEngine>>(s, settings.steps, e.integrator);
    case EngineKind::kBatch:
      break;
  }
  if (e.precision == Precision::kFloat32)
    return std::make_unique<BatchRunner<float>>(e, s, settings);
  return std::make_unique<BatchRunner<double>>(e, s, settings);
}

}  // namespace stickslip::benchmarks
