// Same inputs, same bits: replay, save and load, order and number of robots.
// tests/determinism/test_golden.cc holds them against a file.
#include "check.h"
#include "scenes/tasks.h"
#include "step/bodies.h"

using namespace bodies;

namespace {

constexpr int kRobots = 3;

ModelPtr model(int k) {
  static const ModelPtr models[kRobots] = {box({0.4, 0.3, 0.2}, 3),
                                           tree(41, {.joints = 6, .shapes = true}),
                                           tree(42, {.joints = 9, .shapes = true, .chain = true})};
  return models[k];
}

void start(Robot& robot, int k) {
  const State s = random_state(robot.model(), 90 + k, 2, 0.5);
  robot.set_state(s.q, s.u);
  const int joints = robot.model().num_joints();
  robot.set_pd_gains(std::vector<double>(joints, 10), std::vector<double>(joints, 0.3));
}

World all_of_them(const WorldOptions& o, bool reversed = false) {
  World world(o);
  if (!reversed) world.add_ground();
  for (int i = 0; i < kRobots; ++i) {
    const int k = reversed ? kRobots - 1 - i : i;
    start(world.add_robot(model(k), {.name = std::to_string(k)}), k);
  }
  if (reversed) world.add_ground();
  return world;
}

std::vector<WorldOptions> variants() {
  std::vector<WorldOptions> out;
  for (const Integrator integrator : kBoth) out.push_back(options(1e-3, integrator));
  out.push_back(options(20e-3));
  WorldOptions o = options(1e-3, Integrator::kSemiImplicit);
  o.solver.method = SolveMethod::kPgs, o.solver.tolerance = 1e-6;
  out.push_back(o);
  o.solver.method = SolveMethod::kPerContact;
  out.push_back(o);
  return out;
}

bool same(const Robot& a, const Robot& b) {
  bool equal = same_bits(a.q(), b.q()) && same_bits(a.u(), b.u()) &&
               a.contacts().size() == b.contacts().size();
  for (size_t k = 0; equal && k < a.contacts().size(); ++k)
    equal = same_bits(a.contacts()[k].impulse, b.contacts()[k].impulse);
  return equal;
}

int contacts_of(const World& world) {
  int sum = 0;
  for (int k = 0; k < world.num_robots(); ++k) sum += world.robot(k).info().contacts;
  return sum;
}

}  // namespace

TEST(AReplayGivesTheSameBits) {
  for (const WorldOptions& o : variants()) {
    World a = all_of_them(o), b = all_of_them(o);
    a.step(400);
    for (int k = 0; k < 400; ++k) b.step();
    CHECK(contacts_of(a) > 0);
    for (int k = 0; k < kRobots; ++k) CHECK(same(a.robot(k), b.robot(k)));
    CHECK(a.save_state() == b.save_state());
  }
}

TEST(ASavedStateResumesBitForBitInContact) {
  for (const WorldOptions& o : variants()) {
    World a = all_of_them(o);
    for (const int when : {0, 1, 150, 400}) {
      a.step(when);
      const std::vector<std::uint8_t> saved = a.save_state();
      CHECK(when < 400 || contacts_of(a) > 0);
      // Into a fresh world, into one that has gone elsewhere, and back into itself.
      World fresh = all_of_them(o), other = all_of_them(o);
      other.step(77);
      fresh.load_state(saved);
      other.load_state(saved);
      CHECK(fresh.time() == a.time());
      a.step(60), fresh.step(60), other.step(60);
      for (int k = 0; k < kRobots; ++k) {
        CHECK(same(a.robot(k), fresh.robot(k)));
        CHECK(same(a.robot(k), other.robot(k)));
      }
      CHECK(a.save_state() == fresh.save_state());
      a.load_state(saved);
      CHECK(a.save_state() == saved);
      a.step(60);
      CHECK(a.save_state() == fresh.save_state());
    }
  }
}

TEST(TheOrderInWhichRobotsAreAddedDoesNotShow) {
  for (const WorldOptions& o : variants()) {
    World a = all_of_them(o), b = all_of_them(o, true);
    a.step(300), b.step(300);
    for (int k = 0; k < kRobots; ++k) CHECK(same(a.robot(k), b.robot(kRobots - 1 - k)));
  }
}

TEST(SettingAStateForgetsEverythingBefore) {
  for (const WorldOptions& o : variants()) {
    World a = all_of_them(o), b = all_of_them(o);
    a.step(237);
    for (int k = 0; k < kRobots; ++k) start(a.robot(k), k);
    a.step(100), b.step(100);
    for (int k = 0; k < kRobots; ++k) CHECK(same(a.robot(k), b.robot(k)));
  }
}

TEST(ATaskIsTheSameWhetherItCameByResetOrBegan) {
  using namespace scenes;
  const ModelPtr anymal = load_urdf(STICKSLIP_ANYMAL);
  for (const Integrator integrator : kBoth)
    for (const TaskKind kind : {TaskKind::kDrop, TaskKind::kRandom, TaskKind::kTrot}) {
      const auto run = [&](int before) {
        World world(options(1e-3, integrator));
        world.add_ground();
        Robot& robot = world.add_robot(task_model(kind, anymal));
        Task task(kind, 1e-3);
        task.reset(robot, 0);
        for (int k = 0; k < before; ++k) task.advance(world, robot);
        task.reset(robot, 3);
        for (int k = 0; k < 600; ++k) task.advance(world, robot);
        return copy(robot.q());
      };
      CHECK(same_bits(run(0), run(433)));
    }
}
