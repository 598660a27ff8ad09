// A Batch as an engine of the benchmark: many robots in lockstep, each in another episode and at
// another moment of it, with its own resets and targets.
#pragma once
#include <stickslip/batch.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "benchmarks/compare/engine_choice.h"
#include "benchmarks/compare/episodes.h"
#include "benchmarks/compare/observer.h"
#include "benchmarks/compare/second_opinion.h"

namespace stickslip::benchmarks {

/// T: float or double, the precision of the batch.
template <class T>
class BatchEngine {
 public:
  /// Its robots are `first`, first + 1, ... of the `robots` of a benchmark: robot r begins with
  /// episode r and goes on with r + robots, and so on. The first episodes are cut short so that
  /// after one episode's length of steps all phases are there.
  struct Share {
    int first, count, robots;
  };
  BatchEngine(const Scenario& scenario, const EngineChoice& choice, Share share);

  const Batch& batch() const { return batch_; }

  /// Lays out what the next `steps` (a multiple of kTick) are given from outside: targets, as a
  /// policy hands them over, and the states that episodes begin with. Not timed, as no policy is.
  void prepare(long steps);
  /// Takes these steps: targets, steps, resets.
  template <class Observer>
  void run(long steps, Observer&& observer);

  std::uint64_t hash(std::uint64_t seed) const;  ///< of all velocities

  void mark();    ///< remembers this moment
  void rewind();  ///< goes back to it

 private:
  static Batch make(const Scenario& scenario, const EngineChoice& choice, int num_envs);
  T* data(BatchField field) { return static_cast<T*>(batch_.array(field).data); }
  bool moving() const { return scenario_->hold_steps > 0; }

  long next_event() const;
  void begin(EpisodeClock& clock) const;
  void lay_out_targets(long steps);
  /// The state that the next episode of robot e begins with.
  void lay_out_start(int e);
  void reset_finished();
  void set_targets(const T* targets) { std::copy_n(targets, num_envs_ * joints_, targets_); }
  void find_still();

  void take(long steps, NoObserver&) { batch_.step(static_cast<int>(steps)); }
  void take(long steps, Observer& observer);

  /// One environment as an observer sees an engine.
  struct View {
    BatchEngine* engine;
    int env;
    long age;
    void observe(Snapshot& out) const { engine->observe(env, age, out); }
  };
  void observe(int env, long age, Snapshot& out);
  void ask_second_opinion(Observer& observer);

  const Scenario* scenario_;
  Batch batch_;
  const int num_envs_, robots_, nq_, nu_, joints_, points_;
  const int stride_;  // between the phases of neighbors, see begin
  const T *q_, *u_, *impulse_, *residual_;
  T* targets_;
  const std::uint8_t* active_;
  const std::uint32_t* status_;

  std::vector<EpisodeClock> clocks_;
  std::vector<T> script_;                // targets of the coming ticks, (ticks, num_envs, joints)
  size_t scripted_ = 0;                  // how far it was followed
  std::vector<T> last_;                  // those of the last tick that was laid out
  std::vector<double> next_q_, next_u_;  // the next start of each robot, (num_envs, nq or nu)
  std::vector<int> next_episode_;        // which episode's
  // of reset_finished and observe, here so that a step allocates nothing
  std::vector<std::int64_t> finished_;
  std::vector<double> start_q_, start_u_, target_;
  std::unique_ptr<World> ruler_;
  std::unique_ptr<SecondOpinion> opinion_;  // none: the integrator does not let one
  std::vector<T> before_q_, before_u_;      // a step, for it

  struct Mark {
    std::vector<std::uint8_t> state;
    std::vector<EpisodeClock> clocks;
    std::vector<T> targets, last;
  } mark_;
};

template <class T>
template <class Observer>
void BatchEngine<T>::run(long steps, Observer&& observer) {
  for (long done = 0; done < steps;) {
    for (const EpisodeClock& clock : clocks_)
      if (clock.over()) observer.begin(*this);
    reset_finished();
    if (moving()) {
      set_targets(script_.data() + scripted_);
      scripted_ += static_cast<size_t>(num_envs_) * joints_;
    }
    const long n = std::min(steps - done, next_event());
    take(n, observer);
    for (EpisodeClock& clock : clocks_) clock.age += n;
    if (scenario_->ends_when_still) find_still();
    done += n;
  }
}

extern template class BatchEngine<float>;
extern template class BatchEngine<double>;

}  // namespace stickslip::benchmarks
