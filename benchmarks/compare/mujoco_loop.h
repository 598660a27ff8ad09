// MuJoCo as an engine of the benchmark: elliptic cones, Newton, everything else as it comes.
#pragma once
#include <mujoco/mujoco.h>

#include <memory>

#include "benchmarks/compare/episodes.h"
#include "benchmarks/compare/observer.h"

namespace stickslip::benchmarks {

/// State of Model to MuJoCo's: the angular velocity of a free joint is in body axes there.
void to_mujoco(const Model& model, std::span<const double> q, std::span<const double> u,
               double* qpos, double* qvel);
/// The way back.
void from_mujoco(const Model& model, const double* qpos, const double* qvel, std::span<double> q,
                 std::span<double> u);

class MujocoEngine {
 public:
  explicit MujocoEngine(const Scenario& scenario);  ///< throws std::runtime_error

  void reset(int episode);
  void set_target(std::span<const double> target) {
    std::copy(target.begin(), target.end(), data_->ctrl);
  }
  void step() { mj_step(model_.get(), data_.get()); }
  std::span<const double> velocities() const { return {data_->qvel, u_.size()}; }

  void observe(Snapshot& out) const;

  mjModel* model() { return model_.get(); }
  mjData* data() { return data_.get(); }

 private:
  struct Delete {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  const Scenario* scenario_;
  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;
  std::unique_ptr<World> ruler_;  // kinetic and potential energy by one definition for all engines
  std::vector<double> q_, u_;
};

}  // namespace stickslip::benchmarks
