// Adds the time of a scope's stages to StageTimes; does nothing (one branch) when the world is not
// profiled.
#pragma once
#include <stickslip/world.h>

#include <chrono>

namespace stickslip::step {

class StageTimer {
 public:
  explicit StageTimer(StageTimes* times) : times_(times) {
    if (times_) last_ = Clock::now();
  }
  /// Ends a stage: the time since the last call belongs to it.
  void end(double StageTimes::* stage) {
    if (!times_) return;
    const Clock::time_point now = Clock::now();
    times_->*stage += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  StageTimes* times_;
  Clock::time_point last_;
};

}  // namespace stickslip::step
