// Bad input to a world: an error that names the place, and a world that is as it was. Forces that
// overflow: a status, and a robot that is where it was.
#include <stickslip/errors.h>

#include <limits>

#include "check.h"
#include "step/bodies.h"

using namespace bodies;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                 kInf = std::numeric_limits<double>::infinity();

using Numbers = std::vector<double>;

ModelPtr pair_of_joints() { return tree(31, {.joints = 2, .prismatic = false, .shapes = true}); }

/// Everything a failed call must leave as it was.
Numbers everything(const World& world) {
  Numbers all{world.time(), static_cast<double>(world.num_robots())};
  for (int k = 0; k < world.num_robots(); ++k) {
    const Robot& r = world.robot(k);
    for (const auto& v : {r.q(), r.u(), r.generalized_force(), r.pd_kp(), r.pd_kd(), r.pd_target()})
      all.insert(all.end(), v.begin(), v.end());
    for (char c : r.name()) all.push_back(c);
  }
  const std::vector<std::uint8_t> bytes = world.save_state();
  all.insert(all.end(), bytes.begin(), bytes.end());
  return all;
}

World busy_world() {
  World world(options(1e-3));
  world.add_ground();
  Robot& robot = world.add_robot(pair_of_joints(), {.name = "arm"});
  robot.set_pd_gains(Numbers{3, 4}, Numbers{0.5, 0.25});
  robot.set_pd_target(Numbers{0.1, 0.2});
  robot.set_generalized_force(Numbers(8, 0.125));
  world.step(5);
  return world;
}

}  // namespace

/// The call throws and changes nothing.
#define CHECK_REFUSED(call, fragment)            \
  do {                                           \
    const Numbers before = everything(world);    \
    CHECK_THROWS(call, ModelError, fragment);    \
    CHECK(same_bits(everything(world), before)); \
  } while (0)

TEST(BadOptionsAreNamed) {
  const auto refused = [](auto change, const char* name) {
    WorldOptions o;
    change(o);
    CHECK_THROWS(World{o}, ModelError, name);
    CHECK_THROWS(o.validate(), ModelError, name);
  };
  using O = WorldOptions;
  for (const double bad : {0.0, -1e-3, kNan, kInf})
    refused([=](O& o) { o.time_step = bad; }, "time_step");
  refused([](O& o) { o.gravity[1] = kNan; }, "gravity");
  refused([](O& o) { o.gravity[2] = -kInf; }, "gravity");
  refused([](O& o) { o.max_substeps = 0; }, "max_substeps");
  refused([](O& o) { o.solver.tolerance = 0; }, "tolerance");
  refused([](O& o) { o.solver.tolerance = kNan; }, "tolerance");
  refused([](O& o) { o.solver.relative_tolerance = -1; }, "relative_tolerance");
  refused([](O& o) { o.solver.relative_tolerance = kNan; }, "relative_tolerance");
  refused([](O& o) { o.solver.max_sweeps = 0; }, "max_sweeps");
  refused([](O& o) { o.solver.alpha = 0; }, "alpha");
  refused([](O& o) { o.solver.alpha_min = 2.5; }, "alpha_min");
  refused([](O& o) { o.solver.gamma = kNan; }, "gamma");
  refused(
      [](O& o) {
        o.solver.method = SolveMethod::kPgs;
        o.solver.law = FrictionLaw::kMaxDissipation;
      },
      "pgs");
  refused(
      [](O& o) {
        o.solver.method = SolveMethod::kPerContact;
        o.solver.single_contact = SingleContactMethod::kGoldenSection;
      },
      "golden_section");
}

TEST(ABadStateIsRefusedByItsElement) {
  World world = busy_world();
  Robot& r = world.robot(0);
  const Numbers q = copy(r.q()), u = copy(r.u());
  CHECK_REFUSED(r.set_state(Numbers(8, 0.0), u), "arm.q: expected 9 numbers, got 8");
  CHECK_REFUSED(r.set_state(q, Numbers(9, 0.0)), "arm.u: expected 8 numbers, got 9");
  CHECK_REFUSED(r.set_state(Numbers{}, u), "arm.q");
  for (const double bad : {kNan, kInf, -kInf}) {
    Numbers broken = q;
    broken[8] = bad;
    CHECK_REFUSED(r.set_state(broken, u), "arm.q[8] is not finite");
    broken = u;
    broken[2] = bad;
    CHECK_REFUSED(r.set_state(q, broken), "arm.u[2] is not finite");
  }
  for (const double length : {0.0, 0.9, 1.01, 1e200}) {
    Numbers broken = q;
    for (int k = 3; k < 7; ++k) broken[k] *= length;
    CHECK_REFUSED(r.set_state(broken, u), "quaternion");
  }
  // Near enough: it is normalized.
  Numbers near = q;
  for (int k = 3; k < 7; ++k) near[k] *= 1.0005;
  r.set_state(near, u);
  CHECK_NEAR(largest_difference(r.q(), q), 0, 1e-15);
}

TEST(BadControlIsRefusedByItsElement) {
  World world = busy_world();
  Robot& r = world.robot(0);
  CHECK_REFUSED(r.set_generalized_force(Numbers(2, 0.0)), "arm.generalized_force: expected 8");
  Numbers tau(8, 0.0);
  tau[7] = kNan;
  CHECK_REFUSED(r.set_generalized_force(tau), "arm.generalized_force[7]");
  CHECK_REFUSED(r.set_pd_gains(Numbers{1}, Numbers{1, 1}), "arm.kp");
  CHECK_REFUSED(r.set_pd_gains(Numbers{1, 1}, Numbers{1, 1, 1}), "arm.kd");
  CHECK_REFUSED(r.set_pd_gains(Numbers{1, -1e-9}, Numbers{1, 1}), "arm.kp[1] is negative");
  CHECK_REFUSED(r.set_pd_gains(Numbers{1, 1}, Numbers{-2, 1}), "arm.kd[0] is negative");
  CHECK_REFUSED(r.set_pd_gains(Numbers{1, kInf}, Numbers{1, 1}), "arm.kp[1]");
  CHECK_REFUSED(r.set_pd_target(Numbers{1}), "arm.pd_target: expected 2 numbers, got 1");
  CHECK_REFUSED(r.set_pd_target(Numbers{kNan, 0}), "arm.pd_target[0]");
}

TEST(QuestionsWithoutAnAnswerAreRefused) {
  World world = busy_world();
  const Robot& r = world.robot(0);
  Numbers out(3);
  CHECK_REFUSED(r.mass_matrix(out), "mass_matrix");
  CHECK_REFUSED(r.bias_force(out), "bias_force");
  CHECK_REFUSED(r.forward_dynamics(Numbers(3, 0.0), out), "tau");
  CHECK_REFUSED(r.jacobian("link0", out), "jacobian");
  Numbers jacobian(6 * 8);
  CHECK_REFUSED(r.jacobian("tail", jacobian), "tail");
  CHECK_REFUSED(r.frame_pose("tail"), "link100");  // the error lists what there is
  Numbers g(9);
  CHECK_REFUSED(r.delassus(std::vector<int>{3}, std::vector<Vector3>{{0, 0, 0}}, g),
                "bodies[0] = 3");
  CHECK_REFUSED(r.delassus(std::vector<int>{0}, std::vector<Vector3>{}, g), "points");
  CHECK_REFUSED(r.delassus(std::vector<int>{0}, std::vector<Vector3>{{kNan, 0, 0}}, g),
                "points[0]");
  CHECK_REFUSED(world.robot(1), "robot 1");
  CHECK_REFUSED(world.robot(-1), "robot -1");
  CHECK_REFUSED(world.next_contact_problem(7), "robot 7");
  CHECK_REFUSED(world.last_contact_problem(7), "robot 7");
}

TEST(AWorldTakesOneGroundAndUniqueNames) {
  World world = busy_world();
  CHECK_REFUSED(world.add_ground(1), "ground already");
  CHECK_REFUSED(world.add_robot(nullptr), "null");
  CHECK_REFUSED(world.add_robot(sphere(0.1, 1), {.name = "arm"}), "'arm'");
  RobotOptions o;
  o.position[2] = kNan;
  CHECK_REFUSED(world.add_robot(sphere(0.1, 1), o), "position");
  o = {};
  o.orientation = {0, 0, 0, 0};
  CHECK_REFUSED(world.add_robot(sphere(0.1, 1), o), "orientation");
  o.orientation = {1, kNan, 0, 0};
  CHECK_REFUSED(world.add_robot(sphere(0.1, 1), o), "orientation");
  CHECK_REFUSED(world.step(-1), "step");
  World empty;
  CHECK_THROWS(empty.add_ground(kInf), ModelError, "height");
  empty.add_ground(1);  // the failed call has not taken the ground's place
  CHECK(world.add_robot(sphere(0.1, 1)).name() == "sphere");
  CHECK(world.add_robot(sphere(0.1, 1)).name() == "sphere_2");
}

TEST(BadMaterialPairsAreRefused) {
  World world = busy_world();
  for (const double bad : {-0.1, kNan})
    CHECK_REFUSED(world.set_material_pair("ice", "steel", {bad, 0, 0}),
                  "set_material_pair('ice', 'steel'): friction");
  for (const double bad : {-0.1, 1.1, kNan})
    CHECK_REFUSED(world.set_material_pair("a", "b", {0.5, bad, 0}), "restitution");
  for (const double bad : {-1.0, kNan})
    CHECK_REFUSED(world.set_material_pair("a", "b", {0.5, 0, bad}), "restitution_threshold");
}

TEST(BytesThatAreNoStateOfThisWorldAreRefused) {
  World world = busy_world();
  const std::vector<std::uint8_t> good = world.save_state();
  std::vector<std::uint8_t> bad = good;
  bad.pop_back();
  CHECK_REFUSED(world.load_state(bad), "cut short");
  bad = good;
  bad.push_back(0);
  CHECK_REFUSED(world.load_state(bad), "left over");
  bad = good;
  bad[0] ^= 1;
  CHECK_REFUSED(world.load_state(bad), "not a saved state");
  CHECK_REFUSED(world.load_state({}), "load_state");
  for (size_t n = 0; n < good.size(); n += 7) {
    std::vector<std::uint8_t> cut(good.begin(), good.begin() + n);
    CHECK_THROWS(world.load_state(cut), ModelError, "load_state");
  }
  // Any eight bytes made NaN or huge: a clear error or a state that can go on, never a crash.
  for (size_t at = 0; at + 8 <= good.size(); at += 8) {
    bad = good;
    std::memset(bad.data() + at, 0xff, 8);
    CHECK_REFUSED(world.load_state(bad), "load_state");
  }
  World other;
  other.add_robot(sphere(0.1, 1));
  CHECK_REFUSED(world.load_state(other.save_state()), "the state is of robot");
  World none;
  CHECK_REFUSED(world.load_state(none.save_state()), "0 robots");
  world.load_state(good);
  CHECK(world.save_state() == good);
}

TEST(ForcesThatOverflowLeaveTheRobotInItsLastFiniteState) {
  for (const Integrator integrator : kBoth)
    for (const bool in_contact : {false, true}) {
      // Three robots; the middle one gets the force. A twin world never sees it.
      const ModelPtr m = tree(33, {.joints = 5, .shapes = true});
      const auto build = [&](World& world) {
        if (in_contact) world.add_ground();
        for (int k = 0; k < 3; ++k) {
          const State s = random_state(*m, 50 + k, 1, 0.35);
          world.add_robot(m).set_state(s.q, s.u);
        }
      };
      World world(options(2e-3, integrator)), twin(options(2e-3, integrator));
      build(world), build(twin);
      CHECK(world.step(300) == twin.step(300));
      Robot& hit = world.robot(1);
      CHECK((hit.info().contacts > 0) == in_contact);
      const Numbers q = copy(hit.q()), u = copy(hit.u());
      const std::vector<std::uint8_t> saved = world.save_state();
      for (const double force : {1e308, -1e308, 1.7e308}) {
        hit.set_generalized_force(Numbers(m->nu(), force));
        const StepStatus status = world.step();
        twin.step();
        CHECK((static_cast<unsigned>(status) & static_cast<unsigned>(StepStatus::kNonFinite)) != 0);
        CHECK((static_cast<unsigned>(hit.info().status) &
               static_cast<unsigned>(StepStatus::kNonFinite)) != 0);
        CHECK(same_bits(hit.q(), q));
        CHECK(same_bits(hit.u(), u));
        CHECK(world.time() == twin.time());
        for (const int k : {0, 2}) {
          CHECK(same_bits(world.robot(k).q(), twin.robot(k).q()));
          CHECK(same_bits(world.robot(k).u(), twin.robot(k).u()));
          CHECK(world.robot(k).info().status == twin.robot(k).info().status);
        }
      }
      // Without the force the robot goes on as if nothing had happened, warm start and all.
      hit.set_generalized_force(Numbers(m->nu(), 0.0));
      world.step(50);
      World clean(options(2e-3, integrator));
      build(clean);
      clean.load_state(saved);
      clean.step(50);
      CHECK(same_bits(hit.q(), clean.robot(1).q()));
      CHECK(same_bits(hit.u(), clean.robot(1).u()));
      // What is saved after such a step can be loaded.
      hit.set_generalized_force(Numbers(m->nu(), 1e308));
      world.step();
      clean.load_state(world.save_state());
    }
}

TEST(AnAbsurdButFiniteStateEndsInAStatusAndNotInACrash) {
  for (const Integrator integrator : kBoth)
    for (const double speed : {1e3, 1e8, 1e30, 1e154, 1e200}) {
      const ModelPtr m = pair_of_joints();
      World world(options(20e-3, integrator));
      world.add_ground();
      Robot& robot = world.add_robot(m);
      State s = random_state(*m, 3, 1, 0.3);
      for (double& x : s.u) x *= speed;
      robot.set_state(s.q, s.u);
      for (int k = 0; k < 20; ++k) {
        world.step();
        for (double x : robot.q()) CHECK(std::isfinite(x));
        for (double x : robot.u()) CHECK(std::isfinite(x));
      }
    }
}
