// Adds the time of a scope's stages to the settings' counters; does nothing (one branch) when the
// step is not profiled.
#pragma once
#include "lane/lane.h"
#include "step/step_tables.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

class StageTimer {
 public:
  explicit StageTimer(const StepSettings& settings)
      : clock_(settings.clock), stages_(settings.stages) {
    if (clock_) last_ = clock_();
  }
  /// Ends a stage: the time since the last call belongs to it.
  void end(Stage stage) {
    if (!clock_) return;
    const double now = clock_();
    stages_[stage] += now - last_;
    last_ = now;
  }

 private:
  Clock clock_;
  double* stages_;
  double last_ = 0;
};

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
