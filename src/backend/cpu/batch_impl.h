// What is behind a Batch: one robot as tables, arrays, kernels, threads with a workspace each.
#pragma once
#include <stickslip/batch.h>

#include <atomic>

#include "backend/cpu/batch_memory.h"
#include "backend/cpu/body_parameters.h"
#include "backend/cpu/grouping.h"
#include "backend/cpu/instruction_sets.h"
#include "backend/cpu/thread_pool.h"
#include "layout/tree_layout.h"
#include "world/host_solver.h"
#include "world/robot_scene.h"
#include "world/world_impl.h"

namespace stickslip {

struct Batch::Impl {
  Impl(const World::Impl& world, const BatchOptions& options);

  /// What one thread works with.
  struct Worker {
    Worker(const backend::PackKernels& kernels, const backend::PackScene& scene,
           const StepSolverOptions& solver);
    world::AlignedBlock workspace;
    world::SolverOnHost host;
    step::StepSettings settings;
    double stages[step::kNumStages] = {};
  };

  /// `continues`: a later part of one call.
  std::uint32_t step(int steps, bool continues);
  /// Held while a batch changes. Throws ModelError where another thread holds it.
  class Hold {
   public:
    Hold(Impl& batch, const char* what);
    ~Hold() { batch_.held_.clear(); }
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;

   private:
    Impl& batch_;
  };
  BatchArray array(BatchField field);
  backend::EnvArrays env_arrays();
  void reset(long env, const double* q, const double* u);
  /// Number `row` of what an environment carries besides q and u (PackHistory).
  long history_at(long env, int row) const;
  double history(long env, int row) const;
  void set_history(long env, int row, double value);

  std::vector<std::uint8_t> save();
  void load(std::span<const std::uint8_t> blob);  // throws ModelError before anything has changed

  BatchOptions options;
  WorldOptions world_options;
  ModelPtr model;
  std::string robot_name;
  const backend::PackKernels* kernels;
  std::string instruction_set;
  layout::TreeLayout layout;
  world::RobotScene scene;
  world::AlignedBlock constants;
  backend::PackScene pack_scene;
  backend::PackHistory history_rows;
  step::StepSettings settings;
  long padded;
  backend::Grouping grouping;
  backend::BatchMemory memory;
  world::AlignedBlock history_block;
  backend::BodyParameters bodies;
  bool force = false;  // generalized forces are in use
  std::vector<double> start_q, start_u;
  std::vector<ContactPoint> points;
  std::vector<int> shapes;
  std::vector<std::unique_ptr<Worker>> workers;
  backend::ThreadPool pool;
  long profiled_steps = 0;
  mutable StageTimes times;

 private:
  void fill_pack_scene();
  void fill_parameters(const world::RobotData& robot, const Vec3<double>& gravity);
  void fill_start(const world::RobotData& robot);
  std::vector<std::uint64_t> signature() const;

  std::atomic_flag held_;
  // Of the step that is running.
  backend::EnvArrays running_;
  int running_steps_ = 0;
  std::atomic<std::uint32_t> bits_{0};
  static void regroup_block(void* self, int thread, long block) noexcept;
  static void step_pack(void* self, int thread, long pack) noexcept;
};

}  // namespace stickslip
