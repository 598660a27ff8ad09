#include "benchmarks/compare/runner.h"

#include <memory>
#include <thread>
#include <vector>

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
/// turn, because the cores of a shared machine differ. Batches apart run side by side, each with a
/// thread and a core of its own.
template <class T>
class BatchRunner : public Runner {
 public:
  BatchRunner(const EngineChoice& choice, const Scenario& s, const Settings& settings)
      : threads_(choice.threads),
        shared_(choice.wall_clock() ? most_threads(settings) : 1),
        batches_(choice.apart ? choice.threads : 1),
        robots_(full_packs(settings.robots * (choice.wall_clock() ? Settings::kLargeBatch : 1) /
                           batches_)),
        part_steps_(std::max(
            kTick, settings.steps * work() / (robots_ * batches_) / shared_ / kTick * kTick)) {
    const auto its_cores = cores(0);  // its threads inherit them
    EngineChoice one = choice;
    if (choice.apart) one.threads = 1;
    for (int k = 0; k < batches_; ++k)
      engines_.push_back(std::make_unique<BatchEngine<T>>(s, one, robots_));
  }

  int parts() const override { return threads_ == 1 ? shared_ : 1; }
  std::unique_ptr<OnCores> cores(int part) const override {
    if (threads_ == 0) return nullptr;
    return std::make_unique<OnCores>(part, threads_);
  }
  void prepare() override {
    for (auto& engine : engines_) engine->prepare(steps());
  }
  void run() override {
    const auto run = [this](BatchEngine<T>& engine) {
      NoObserver nobody;
      engine.run(part_steps_ * (shared_ / parts()), nobody);
    };
    if (engines_.size() == 1) return run(*engines_.front());
    std::vector<std::jthread> side_by_side;
    for (size_t k = 0; k < engines_.size(); ++k)
      side_by_side.emplace_back([this, run, k] {
        const OnCores its_core(static_cast<int>(k), 1);
        run(*engines_[k]);
      });
  }
  void mark() override {
    for (auto& engine : engines_) engine->mark();
  }
  void rewind() override {
    for (auto& engine : engines_) engine->rewind();
  }
  void watch(Observer& observer) override {
    const auto its_cores = cores(0);
    prepare();
    for (auto& engine : engines_) engine->run(steps(), observer);
  }
  std::uint64_t hash(std::uint64_t seed) const override {
    for (const auto& engine : engines_) seed = engine->hash(seed);
    return seed;
  }
  long robot_steps() const override { return steps() * robots(); }
  int robots() const override { return robots_ * batches_; }
  std::string instruction_set() const override {
    return engines_.front()->batch().instruction_set();
  }

 private:
  long steps() const { return part_steps_ * shared_; }  // of a repetition
  int work() const { return threads_ > 0 ? Settings::kThreadWork : Settings::kBatchWork; }
  static int full_packs(int robots) {
    return std::max(1, robots / Settings::kFullPack) * Settings::kFullPack;
  }
  static int most_threads(const Settings& settings) {
    int most = 1;
    for (const EngineChoice& e : settings.engines) most = std::max(most, e.threads);
    return std::min(most, num_cores());
  }

  int threads_;  // 0: one, on the core of everybody else
  int shared_;   // cores of the engine with the most threads
  int batches_;  // one, or as many as threads: apart
  int robots_;   // of a batch
  long part_steps_;
  std::vector<std::unique_ptr<BatchEngine<T>>> engines_;
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
