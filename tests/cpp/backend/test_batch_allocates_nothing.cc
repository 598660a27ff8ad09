// A step of a batch allocates nothing, in no thread: every allocator of the program counts.
#include <limits>

#include "allocation_counter.h"
#include "backend/staggered_task.h"

using namespace environments;

namespace {

/// Rows that are asked for once: asking describes an array anew each time.
template <class T>
std::vector<std::span<T>> rows(Batch& batch, BatchField field) {
  std::vector<std::span<T>> out;
  for (int env = 0; env < batch.num_envs(); ++env) out.push_back(row<T>(batch, field, env));
  return out;
}

struct Count {
  long allocations = 0, contacts = 0, unconverged = 0, non_finite = 0;
};

/// `calls` calls of `steps` steps, with the targets of `before`.
template <class T, class F>
Count count(Batch& batch, int calls, int steps, F&& before) {
  const auto targets = rows<T>(batch, BatchField::kPdTarget);
  const auto active = rows<std::uint8_t>(batch, BatchField::kContactActive);
  const auto status = rows<std::uint32_t>(batch, BatchField::kStatus);
  Count out;
  for (int call = 0; call < calls; ++call) {
    before(call, targets);
    const long start = allocations;
    batch.step(steps);
    out.allocations += allocations - start;
    for (const auto& points : active)
      for (const std::uint8_t a : points) out.contacts += a;
    for (const auto& bits : status) {
      out.unconverged += (bits[0] & 1u) != 0;
      out.non_finite += (bits[0] & 2u) != 0;
    }
  }
  return out;
}

template <class T>
void check_tasks(Precision precision) {
  const ModelPtr anymal = load_urdf(STICKSLIP_ANYMAL);
  for (const TaskKind kind : kTasks)
    for (const Integrator integrator : kBoth) {
      const StaggeredTask task{kind, 37};
      Batch batch(task.make_world(anymal, integrator), batch_options(37, precision, 2));
      batch.set_profiling(true);
      // 1000 steps, with the resets that give the environments their episodes.
      const Count c = count<T>(batch, 1000 / StaggeredTask::kHold, StaggeredTask::kHold,
                               [&](int call, const std::vector<std::span<T>>& targets) {
                                 task.before(
                                     call * StaggeredTask::kHold,
                                     [&](int env, const State& s) { reset(batch, env, s); },
                                     [&](int env, const std::vector<double>& t) {
                                       for (size_t k = 0; k < t.size(); ++k)
                                         targets[env][k] = static_cast<T>(t[k]);
                                     });
                               });
      if (c.allocations) std::printf("  %s: %ld allocations\n", task.spec().name, c.allocations);
      CHECK(c.allocations == 0);
      CHECK(c.contacts > 1000);
      CHECK(c.non_finite == 0);
    }
}

/// A tree as branched as a humanoid with hands, thrown with large steps: substeps, overlap,
/// fallbacks, the chain that finishes what the pack leaves; parameters of every kind change, and
/// one environment is not finite.
template <class T>
void check_hard_scene(Precision precision) {
  const ModelPtr m = tree(77, {.joints = 36, .prismatic = false, .shapes = true, .damping = 0.1});
  for (const Integrator integrator : kBoth) {
    World world(options(integrator == Integrator::kEnergySafe ? 20e-3 : 2e-3, integrator));
    world.add_ground();
    Robot& robot = world.add_robot(m);
    robot.set_pd_gains(std::vector<double>(36, 5.0), std::vector<double>(36, 0.1));
    Batch batch(world, batch_options(11, precision, 2));
    batch.set_profiling(true);
    for (int env = 0; env < 11; ++env)
      reset(batch, env, random_state(*m, static_cast<unsigned>(env), 3, 0.5));
    std::vector<std::vector<std::span<T>>> parameters;
    for (const BatchField f :
         {BatchField::kKp, BatchField::kKd, BatchField::kFriction, BatchField::kGravity,
          BatchField::kBodyMass, BatchField::kBodyCom, BatchField::kBodyInertia,
          BatchField::kExternalWrench, BatchField::kGeneralizedForce})
      parameters.push_back(rows<T>(batch, f));
    const Count c = count<T>(batch, 60, 1, [&](int call, const std::vector<std::span<T>>& targets) {
      const int env = call % 11;
      for (T& x : targets[env]) x += static_cast<T>(0.01);
      for (const auto& p : parameters)
        for (T& x : p[env]) x *= static_cast<T>(1.001);
      parameters[7][env][8] += 1;
      targets[5][3] = std::numeric_limits<T>::quiet_NaN();
    });
    if (c.allocations) std::printf("  tree: %ld allocations\n", c.allocations);
    CHECK(c.allocations == 0);
    CHECK(c.contacts > 1000);
    CHECK(c.non_finite == 60);
  }
}

}  // namespace

TEST(TheCounterSeesWhatThreadsAllocate) {
  const long before = allocations;
  {
    const std::vector<double> v(100);
  }
  CHECK(allocations > before);
}

TEST(TasksAllocateNothingInAThousandSteps) {
  check_tasks<float>(Precision::kFloat32);
  check_tasks<double>(Precision::kFloat64);
}

TEST(HardContactsAndChangingParametersAllocateNothing) {
  check_hard_scene<float>(Precision::kFloat32);
  check_hard_scene<double>(Precision::kFloat64);
}
