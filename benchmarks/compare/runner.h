// An engine on a task, cut into repetitions that can be timed, and watched again later.
#pragma once
#include <memory>

#include "benchmarks/compare/cores.h"
#include "benchmarks/compare/engine_choice.h"
#include "benchmarks/compare/observer.h"

namespace stickslip::benchmarks {

struct Settings {
  long steps = 2000;     ///< per repetition; a batch takes kBatchWork times as many robot-steps
  int repetitions = 40;  ///< counted; one more warms up
  int robots = 64;       ///< of a batch; kLargeBatch times as many where threads are compared
  std::vector<EngineChoice> engines;
  bool statistics = true;

  static constexpr int kFullPack = 16;  // of the widest instructions
  static constexpr int kBatchWork = 16, kLargeBatch = 32;
  // Where threads are compared: long against a move to another core, and more rounds, because a
  // wall clock knows more interruptions.
  static constexpr int kThreadWork = 40, kThreadRounds = 3;
};

double wall_seconds();  ///< since some moment [s]

class Runner {
 public:
  virtual ~Runner() = default;
  /// A repetition may come in parts of equal length on different cores: its speed is their mean.
  virtual int parts() const { return 1; }
  /// What a part runs on as long as it lives; null: where everybody else does.
  virtual std::unique_ptr<OnCores> cores(int) const { return nullptr; }
  virtual void prepare() {}  ///< for the next repetition; not timed
  /// The next part of a repetition; returns its wall time [s], of batches apart that in which they
  /// would do it all at the sum of their speeds.
  virtual double run() = 0;
  virtual void mark() = 0;  ///< here the first counted repetition begins
  virtual void rewind() = 0;
  virtual void watch(Observer& observer) = 0;  ///< one repetition, observed

  virtual std::uint64_t hash(std::uint64_t seed) const = 0;  ///< of all velocities
  virtual long robot_steps() const = 0;                      ///< timed in a repetition
  virtual int robots() const { return 1; }
  virtual std::string instruction_set() const { return ""; }  ///< of a batch
};

/// Throws ModelError where a batch cannot be made so: another instruction set than the machine has,
/// more threads than cores, robots that cannot be shared out.
std::unique_ptr<Runner> make_runner(const EngineChoice& engine, const Scenario& scenario,
                                    const Settings& settings);

}  // namespace stickslip::benchmarks
