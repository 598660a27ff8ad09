#include "benchmarks/compare/runner.h"

#include <stickslip/errors.h>

#include <algorithm>
#include <barrier>
#include <chrono>
#include <cmath>
#include <future>
#include <optional>
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

  double run() override {
    const double start = wall_seconds();
    run_episodes(engine_, *scenario_, clock_, steps_, NoObserver{});
    return wall_seconds() - start;
  }
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
        compared_cores_(choice.wall_clock() ? most_threads(settings) : 1),
        robots_(settings.robots * (choice.wall_clock() ? Settings::kLargeBatch : 1)),
        part_steps_(kTick * std::max(1l, std::lround(double(settings.steps) * work() / robots_ /
                                                     compared_cores_ / kTick))) {
    require(threads_ <= num_cores(), choice.name + " needs a core for each thread; there are " +
                                         std::to_string(num_cores()));
    require(threads_ <= 1 || threads_ == compared_cores_,
            choice.name + ": run one number of threads at a time");
    const int batches = choice.apart ? threads_ : 1, share = robots_ / batches;
    require(share % Settings::kFullPack == 0 && share * batches == robots_,
            choice.name + ": " + std::to_string(robots_ / Settings::kFullPack) +
                " full packs of robots cannot be shared out evenly");
    std::optional<OnCores> of_its_threads;
    if (threads_ > 0) of_its_threads.emplace(0, threads_);
    for (int k = 0; k < batches; ++k)
      engines_.push_back(std::make_unique<BatchEngine<T>>(
          s, choice, typename BatchEngine<T>::Share{k * share, share, robots_}));
  }

  int parts() const override { return threads_ == 1 ? compared_cores_ : 1; }
  std::unique_ptr<OnCores> cores(int part) const override {
    if (threads_ == 0) return nullptr;
    return std::make_unique<OnCores>(part, 1);  // other threads of a batch are pinned by it
  }
  void prepare() override {
    for (auto& engine : engines_) engine->prepare(steps());
  }
  double run() override {
    if (engines_.size() == 1) return timed(*engines_.front());
    std::barrier all_there(static_cast<std::ptrdiff_t>(engines_.size()));
    std::vector<std::future<double>> side_by_side;
    for (size_t k = 0; k < engines_.size(); ++k)
      side_by_side.push_back(std::async(std::launch::async, [this, k, &all_there] {
        const OnCores its_core(static_cast<int>(k), 1);
        all_there.arrive_and_wait();
        return timed(*engines_[k]);
      }));
    double speed = 0;  // shares per second: nobody waits for the slowest
    for (auto& seconds : side_by_side) speed += 1 / seconds.get();
    return static_cast<double>(engines_.size()) / speed;
  }
  void mark() override {
    for (auto& engine : engines_) engine->mark();
  }
  void rewind() override {
    for (auto& engine : engines_) engine->rewind();
  }
  void watch(Observer& observer) override {
    const auto its_core = cores(0);
    prepare();
    for (auto& engine : engines_) engine->run(steps(), observer);
  }
  std::uint64_t hash(std::uint64_t seed) const override {
    for (const auto& engine : engines_) seed = engine->hash(seed);
    return seed;
  }
  long robot_steps() const override { return part_steps_ * compared_cores_ * robots_; }
  int robots() const override { return robots_; }
  std::string instruction_set() const override {
    return engines_.front()->batch().instruction_set();
  }

 private:
  static void require(bool holds, const std::string& what) {
    if (!holds) throw ModelError(what);
  }
  double timed(BatchEngine<T>& engine) const {
    NoObserver nobody;
    const long shares = compared_cores_ / parts();
    engine.run(warm_up() * shares, nobody);
    const double start = wall_seconds();
    engine.run(part_steps_ * shares, nobody);
    return wall_seconds() - start;
  }
  /// Steps before those of a part: caches are cold, threads asleep, and one thread begins as often
  /// as it has cores.
  long warm_up() const { return threads_ > 0 ? kTick : 0; }
  /// Of a repetition.
  long steps() const { return (warm_up() + part_steps_) * compared_cores_; }
  int work() const { return threads_ > 0 ? Settings::kThreadWork : Settings::kBatchWork; }
  static int most_threads(const Settings& settings) {
    int most = 1;
    for (const EngineChoice& e : settings.engines) most = std::max(most, e.threads);
    return std::min(most, num_cores());
  }

  int threads_;         // 0: one, on the core of everybody else
  int compared_cores_;  // cores of the engine with the most threads
  int robots_;          // of all batches
  long part_steps_;     // timed; a part is what one core takes of a repetition
  std::vector<std::unique_ptr<BatchEngine<T>>> engines_;  // one; apart: as many as threads
};

}  // namespace

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

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
