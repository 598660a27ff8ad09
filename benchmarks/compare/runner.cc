#include "benchmarks/compare/runner.h"

#include <optional>

#include "benchmarks/compare/batch_loop.h"
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
  EpisodeClock clock_{-1}, mark_;
};

/// Threads have as many cores; one thread that several are compared with has each of theirs in
/// turn, because the cores of a shared machine differ.
template <class T>
class BatchRunner : public Runner {
 public:
  BatchRunner(const EngineChoice& choice, const Scenario& s, const Settings& settings)
      : threads_(choice.threads),
        shared_(choice.wall_clock() ? most_threads(settings) : 1),
        robots_(settings.robots * (choice.wall_clock() ? Settings::kLargeBatch : 1)),
        part_steps_(std::max(kTick, settings.steps * work() / robots_ / shared_ / kTick * kTick)) {
    const auto its_cores = cores(0);  // its threads inherit them
    engine_.emplace(s, choice, robots_);
  }

  int parts() const override { return threads_ == 1 ? shared_ : 1; }
  std::unique_ptr<OnCores> cores(int part) const override {
    if (threads_ == 0) return nullptr;
    return std::make_unique<OnCores>(part, threads_);
  }
  void prepare() override { engine_->prepare(robot_steps() / robots_); }
  void run() override {
    NoObserver nobody;
    engine_->run(part_steps_ * (shared_ / parts()), nobody);
  }
  void mark() override { engine_->mark(); }
  void rewind() override { engine_->rewind(); }
  void watch(Observer& observer) override {
    const auto its_cores = cores(0);
    engine_->prepare(robot_steps() / robots_);
    engine_->run(robot_steps() / robots_, observer);
  }
  std::uint64_t hash(std::uint64_t seed) const override { return engine_->hash(seed); }
  long robot_steps() const override { return part_steps_ * shared_ * robots_; }
  int robots() const override { return robots_; }
  std::string instruction_set() const override { return engine_->batch().instruction_set(); }

 private:
  int work() const { return threads_ > 0 ? Settings::kThreadWork : Settings::kBatchWork; }
  static int most_threads(const Settings& settings) {
    int most = 1;
    for (const EngineChoice& e : settings.engines) most = std::max(most, e.threads);
    return std::min(most, num_cores());
  }

  int threads_;  // 0: one, on the core of everybody else
  int shared_;   // cores of the engine with the most threads
  int robots_;
  long part_steps_;
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
