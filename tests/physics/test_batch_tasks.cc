// Whole tasks in batches: what a solve leaves, and that single precision shows the physics of
// worlds.
#include "backend/staggered_task.h"

using namespace environments;

namespace {

constexpr int kEnvs = 48;

const ModelPtr& anymal() {
  static const ModelPtr model = load_urdf(STICKSLIP_ANYMAL);
  return model;
}

/// Calls observe(batch) after each of `steps` steps.
template <class F>
void run(const StaggeredTask& task, Integrator integrator, Precision precision, int steps,
         F&& observe) {
  Batch batch(task.make_world(anymal(), integrator), batch_options(task.num_envs, precision, 2));
  for (int step = 0; step < steps; ++step) {
    if (step % StaggeredTask::kHold == 0)
      task.before(
          step, [&](int env, const State& s) { reset(batch, env, s); },
          [&](int env, const std::vector<double>& t) {
            set_row(batch, BatchField::kPdTarget, env, t);
          });
    batch.step();
    observe(batch);
  }
}

struct Left {
  long steps = 0, above = 0, hidden = 0;  // above the limit, and not flagged
  double worst = 0;
};

Left residuals(TaskKind kind, Integrator integrator, Precision precision, double limit) {
  Left left;
  run({kind, kEnvs, 1e-3}, integrator, precision, 1500, [&](Batch& batch) {
    const BatchArray residual = batch.array(BatchField::kResidual),
                     bits = batch.array(BatchField::kStatus);
    for (int env = 0; env < kEnvs; ++env) {
      const double r = residual.type == NumberType::kFloat32
                           ? static_cast<double>(row<float>(residual, env)[0])
                           : row<double>(residual, env)[0];
      ++left.steps;
      left.above += !(r <= limit);
      left.hidden += !(r <= limit) && row<std::uint32_t>(bits, env)[0] == 0;
      left.worst = std::fmax(left.worst, r);
    }
  });
  return left;
}

}  // namespace

TEST(ResidualsAreSmallInAllButOneOfTenThousandRobotSteps) {
  for (const auto& [precision, limit] :
       {std::pair{Precision::kFloat32, 1e-5}, std::pair{Precision::kFloat64, 1e-8}})
    for (const Integrator integrator : kBoth)
      for (const TaskKind kind : kTasks) {
        const Left left = residuals(kind, integrator, precision, limit);
        std::printf("  %-14s %s %s: above %.0e m/s in %ld of %ld, worst %.1e\n",
                    scenes::task_spec(kind).name,
                    integrator == Integrator::kEnergySafe ? "energy_safe  " : "semi_implicit",
                    precision == Precision::kFloat32 ? "float32" : "float64", limit, left.above,
                    left.steps, left.worst);
        CHECK(1e4 * static_cast<double>(left.above) <= static_cast<double>(left.steps));
        CHECK(left.hidden == 0);
      }
}

TEST(SinglePrecisionEndsWhereDoublePrecisionDoes) {
  // Robots that stand do so alike; of those that fall and tumble only the mean has to be the same.
  for (const Integrator integrator : kBoth)
    for (const TaskKind kind : kTasks) {
      std::vector<double> height[2];
      for (const Precision precision : {Precision::kFloat32, Precision::kFloat64}) {
        std::vector<double>& h = height[precision == Precision::kFloat64];
        run({kind, kEnvs, 2e-3}, integrator, precision, 700, [&](Batch& batch) {
          h.resize(kEnvs);
          for (int env = 0; env < kEnvs; ++env) h[env] = number(batch, BatchField::kQ, env, 2);
        });
      }
      double apart = 0, mean[2] = {0, 0};
      for (int env = 0; env < kEnvs; ++env) {
        apart = std::fmax(apart, std::fabs(height[0][env] - height[1][env]));
        for (int k = 0; k < 2; ++k) mean[k] += height[k][env] / kEnvs;
      }
      std::printf("  %-14s: heights %.4f and %.4f m, apart by at most %.1e\n",
                  scenes::task_spec(kind).name, mean[0], mean[1], apart);
      if (kind == TaskKind::kStand || kind == TaskKind::kOpenLoopTrot) CHECK_NEAR(apart, 0, 1e-4);
      CHECK_NEAR(mean[0], mean[1], 2e-3);
    }
}
