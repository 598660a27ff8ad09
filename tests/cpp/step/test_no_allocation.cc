// A step allocates nothing: every allocator of the program counts.
#include "allocation_counter.h"
#include "check.h"
#include "scenes/tasks.h"
#include "step/bodies.h"

using namespace bodies;

namespace {

struct Method {
  const char* name;
  SolveMethod method;
  FrictionLaw law;
  SingleContactMethod single;
};
constexpr Method kMethods[] = {
    {"auto", SolveMethod::kAuto, FrictionLaw::kCoulomb, SingleContactMethod::kHalley},
    {"auto, max_dissipation", SolveMethod::kAuto, FrictionLaw::kMaxDissipation,
     SingleContactMethod::kHalley},
    {"per_contact", SolveMethod::kPerContact, FrictionLaw::kCoulomb, SingleContactMethod::kHalley},
    {"per_contact, bisection", SolveMethod::kPerContact, FrictionLaw::kMaxDissipation,
     SingleContactMethod::kBisection},
    {"pgs", SolveMethod::kPgs, FrictionLaw::kCoulomb, SingleContactMethod::kHalley}};

WorldOptions with(const Method& m, Integrator integrator, double dt) {
  WorldOptions o = options(dt, integrator);
  o.solver.method = m.method, o.solver.law = m.law, o.solver.single_contact = m.single;
  // As the paper's Table II; a tight sum costs thousands of sweeps and shows nothing here.
  if (m.method != SolveMethod::kAuto) o.solver.tolerance = 1e-6, o.solver.max_sweeps = 300;
  return o;
}

void check_none(const char* what, const Method& m, long count) {
  if (count) std::printf("  %s, %s: %ld allocations\n", what, m.name, count);
  CHECK(count == 0);
}

}  // namespace

TEST(TheCounterCounts) {
  const long before = allocations;
  const std::vector<double> v(100);
  CHECK(allocations > before && v.size() == 100);
}

TEST(TasksOfTheScenesAllocateNothingInAStep) {
  using namespace scenes;
  const ModelPtr anymal = load_urdf(STICKSLIP_ANYMAL);
  for (const TaskKind kind :
       {TaskKind::kStand, TaskKind::kHang, TaskKind::kDrop, TaskKind::kRandom, TaskKind::kTrot})
    for (const Method& m : kMethods)
      for (const Integrator integrator : kBoth) {
        World world(with(m, integrator, 1e-3));
        world.add_ground();
        Robot& robot = world.add_robot(task_model(kind, anymal));
        world.set_profiling(true);
        Task task(kind, 1e-3);
        task.reset(robot, 0);
        for (int k = 0; k < 20; ++k) task.advance(world, robot);
        // 1000 steps for the default method, over landing and resets; fewer for the others.
        const int steps = m.method == SolveMethod::kAuto ? 1000 : 500;
        long contacts = 0;
        const long before = allocations;
        for (int k = 0; k < steps; ++k) {
          task.advance(world, robot);
          contacts += static_cast<long>(robot.contacts().size());
        }
        check_none(task.spec().name, m, allocations - before);
        CHECK(contacts > 0);
      }
}

TEST(LargeStepsAndManyContactsAllocateNothing) {
  // A tree as branched as a humanoid with hands, thrown at 20 ms: substeps, overlap, fallback.
  const ModelPtr m = tree(77, {.joints = 36, .prismatic = false, .shapes = true, .damping = 0.1});
  for (const Method& method : kMethods)
    for (const Integrator integrator : kBoth) {
      World world(with(method, integrator, integrator == Integrator::kEnergySafe ? 20e-3 : 1e-3));
      world.add_ground();
      Robot& robot = world.add_robot(m);
      world.set_profiling(true);
      const State s = random_state(*m, 1, 3, 0.5);
      robot.set_state(s.q, s.u);
      robot.set_pd_gains(std::vector<double>(36, 5.0), std::vector<double>(36, 0.1));
      const std::vector<double> target(36, 0.2), tau(42, 0.1);
      world.step(2);
      const int steps = method.method == SolveMethod::kAuto ? 1000 : 450;
      size_t contacts = 0;
      const long before = allocations;
      for (int k = 0; k < steps; ++k) {
        robot.set_pd_target(target);
        robot.set_generalized_force(tau);
        world.step();
        contacts = std::max(contacts, robot.contacts().size());
      }
      check_none("tree", method, allocations - before);
      CHECK(contacts > 5);
    }
}

TEST(ASecondRobotAndChangedGainsAllocateNothing) {
  World world(options(1e-3));
  world.add_ground();
  for (int k = 0; k < 2; ++k) {
    const ModelPtr m = tree(80 + k, {.joints = 6, .shapes = true});
    const State s = random_state(*m, k, 1, 0.5);
    world.add_robot(m).set_state(s.q, s.u);
  }
  world.step(2);
  std::vector<double> gains(6, 1.0);
  const State again = random_state(world.robot(0).model(), 3, 1, 0.5);
  const long before = allocations;
  for (int k = 0; k < 1000; ++k) {
    gains[k % 6] += 0.1;
    world.robot(0).set_pd_gains(gains, gains);
    if (k == 500) world.robot(0).set_state(again.q, again.u);
    world.step();
  }
  CHECK(allocations == before);
}
