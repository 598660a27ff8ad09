// Where the contact solve of a step starts: the trend of the last impulses (semi-implicit).
#include "check.h"
#include "scenes/tasks.h"
#include "step/bodies.h"

using namespace bodies;
using scenes::Task;
using scenes::TaskKind;

namespace {

WorldOptions options(bool warm_start) {
  WorldOptions o;
  o.integrator = Integrator::kSemiImplicit;
  o.solver.warm_start = warm_start;
  return o;
}

/// Sweeps and Newton steps of half a second, after a second of standing, with a weight on the base
/// that `load` gives for each step [N].
template <class F>
int work_of_standing(bool warm_start, const F& load) {
  const ModelPtr anymal = load_urdf(STICKSLIP_ANYMAL, BaseType::kFloating);
  World world(options(warm_start));
  world.add_ground();
  Robot& robot = world.add_robot(scenes::task_model(TaskKind::kStand, anymal));
  Task task(TaskKind::kStand, 1e-3);
  task.reset(robot, 0);
  int work = 0;
  std::vector<double> force(18, 0.0);
  for (int k = 0; k < 1500; ++k) {
    if (k >= 1000) {
      force[2] = -load(k - 1000);
      robot.set_generalized_force(force);
    }
    task.before_step(robot);
    world.step();
    CHECK(robot.info().status == StepStatus::kOk);
    if (k >= 1000) work += robot.info().sweeps + robot.info().newton_steps;
  }
  return work;
}

}  // namespace

TEST(ALoadThatGrowsSteadilyCostsLittleMoreThanRest) {
  const int rest = work_of_standing(true, [](int) { return 0.0; });
  const int steady = work_of_standing(true, [](int k) { return 0.2 * k; });
  const int shaking = work_of_standing(true, [](int k) { return k % 2 ? 50.0 : 0.0; });
  const int cold = work_of_standing(false, [](int k) { return 0.2 * k; });
  std::printf(
      "  sweeps and Newton steps of 500 steps: at rest %d, growing load %d, shaking %d; "
      "growing load from zero impulses %d\n",
      rest, steady, shaking, cold);
  CHECK(steady < 1.4 * rest);
  CHECK(shaking > 1.5 * steady && cold > 1.5 * steady);
}

TEST(ImpulsesThatOnlyPressPointsAgainstEachOtherComeToRest) {
  // Four wheels of a cart that was pushed about: more impulses than motions.
  ModelBuilder builder("cart");
  builder.add_link("body", Inertial{20, {0.1, 0.05, 0}, {0.5, 0, 0, 1, 0, 1}});
  for (int k = 0; k < 4; ++k) {
    const std::string name = "wheel" + std::to_string(k);
    builder.add_link(name, inertial(1, {0.005, 0.005, 0.005}));
    builder.add_shape(name, shape(ShapeType::kSphere, {0.1, 0, 0}));
    LinkJoint joint;
    joint.name = name, joint.parent = "body", joint.child = name;
    joint.type = LinkJointType::kRevolute;
    joint.axis = {0, 1, 0};
    joint.pose.position = {k & 1 ? 0.3 : -0.3, k & 2 ? 0.2 : -0.2, 0};
    builder.add_joint(joint);
  }
  World world(options(true));
  world.add_ground();
  Robot& robot = world.add_robot(builder.build(BaseType::kFloating));
  std::vector<double> q(11, 0.0), u(10, 0.0), push(10, 0.0);
  q[2] = 0.0999, q[3] = 1;
  robot.set_state(q, u);
  Random random(3);
  const auto forces = [&] {
    std::vector<double> f;
    for (const Contact& c : robot.contacts()) f.push_back(c.impulse[2] / 1e-3);
    return f;
  };
  std::vector<double> early;
  for (int k = 0; k < 4000; ++k) {
    for (int i = 0; i < 6; ++i) push[i] = k < 1000 ? 50 * random.normal() : 0;
    robot.set_generalized_force(push);
    world.step();
    if (k == 2000) early = forces();
  }
  const std::vector<double> late = forces();
  CHECK(early.size() == 4 && late.size() == 4);
  std::printf("  largest change of a wheel's load in two seconds of rest %.1e N\n",
              largest_difference(early, late));
  CHECK(largest_difference(early, late) < 1e-3);
}

TEST(ASavedStateKeepsTheTrend) {
  // A box that rolls on its edges: the impulses of their points change in each step.
  World world(options(true));
  world.add_ground();
  Robot& robot = world.add_robot(box({0.4, 0.3, 0.2}, 5));
  std::vector<double> q = {0, 0, 0.11, 1, 0, 0, 0}, u = {0.5, 0, -0.2, 0, 1, 0};
  robot.set_state(q, u);
  for (int k = 0; k < 60; ++k) world.step();
  const auto saved = world.save_state();
  std::vector<double> first;
  for (int run = 0; run < 2; ++run) {
    for (int k = 0; k < 40; ++k) world.step();
    const std::vector<double> end = copy(robot.u());
    if (run == 0) first = end, world.load_state(saved);
    CHECK(run == 0 || same_bits(first, end));
  }
}
