// Contact of robots on a fixed base: few dofs, so Delassus blocks of rank one and two.
#include <stickslip/model_builder.h>
#include <stickslip/world.h>

#include <cmath>
#include <limits>

#include "step/twin_world.h"

using namespace stickslip;

namespace {

enum class Kind { kSlider, kArm, kTwoLinkArm };
constexpr Kind kKinds[] = {Kind::kSlider, Kind::kArm, Kind::kTwoLinkArm};

void add_rod(ModelBuilder& builder, const std::string& name, const std::string& parent,
             double length, bool slider, double joint_height) {
  Inertial in;
  in.mass = 1;
  in.center_of_mass = {0, 0, slider ? 0 : -0.5 * length};
  in.inertia = {0.02, 0, 0, 0.02, 0, 0.01};
  builder.add_link(name, in);
  LinkJoint joint;
  joint.name = name + "_joint";
  joint.type = slider ? LinkJointType::kPrismatic : LinkJointType::kRevolute;
  joint.parent = parent;
  joint.child = name;
  joint.pose.position = {0, 0, joint_height};
  joint.axis = {0, slider ? 0.0 : 1.0, slider ? 1.0 : 0.0};
  builder.add_joint(joint);
}

ModelPtr make(Kind kind) {
  ModelBuilder builder("fixed");
  builder.add_link("base");
  const bool slider = kind == Kind::kSlider;
  add_rod(builder, "first", "base", 0.5, slider, 0);
  if (kind == Kind::kTwoLinkArm) add_rod(builder, "second", "first", 0.4, false, -0.5);
  Shape tip;
  tip.size = {0.05, 0, 0};
  tip.pose.position = {0, 0, slider ? 0 : kind == Kind::kArm ? -0.5 : -0.4};
  builder.add_shape(kind == Kind::kTwoLinkArm ? "second" : "first", tip);
  return builder.build(BaseType::kFixed);
}

struct Run {
  double start, end, growth = 0, deepest = 0, fastest = 0, largest_impulse = 0;
  int not_ok = 0;
};

Run run(Kind kind, const WorldOptions& options, const MaterialPair& law, double seconds) {
  bodies::TwinWorld world(options);
  world.add_ground();
  world.set_material_pair("default", "default", law);
  RobotOptions where;
  where.position = {0, 0, kind == Kind::kSlider ? 1.0 : kind == Kind::kArm ? 0.35 : 0.6};
  Robot& robot = world.add_robot(make(kind), where);
  const double q[2] = {kind == Kind::kSlider ? 0 : 1.5, 0.3}, u[2] = {0, 0};
  robot.set_state({q, robot.q().size()}, {u, robot.u().size()});
  Run r;
  r.start = r.end = robot.mechanical_energy();
  double lowest = r.start;
  for (long k = 0; k < std::lround(seconds / options.time_step); ++k) {
    r.not_ok += world.step() != StepStatus::kOk;
    r.end = robot.mechanical_energy();
    lowest = std::fmin(lowest, r.end);
    r.growth = std::fmax(r.growth, r.end - lowest);
    for (double x : robot.u()) r.fastest = std::fmax(r.fastest, std::fabs(x));
    for (const Contact& c : robot.contacts()) {
      r.deepest = std::fmax(r.deepest, -c.gap);
      for (double x : c.impulse) r.largest_impulse = std::fmax(r.largest_impulse, std::fabs(x));
    }
  }
  return r;
}

WorldOptions options(Integrator integrator, double dt) {
  WorldOptions o;
  o.integrator = integrator;
  o.time_step = dt;
  return o;
}

}  // namespace

TEST(AnElasticSliderKeepsItsEnergyThroughBounces) {
  for (double dt : {1e-3, 5e-3, 2e-2}) {
    const Run r = run(Kind::kSlider, options(Integrator::kEnergySafe, dt), {0.5, 1, 0}, 3);
    CHECK_NEAR(r.end, r.start, 1e-9);
    CHECK(r.growth < 1e-9);
    CHECK(r.fastest > 4);  // it does bounce
  }
}

TEST(AnElasticArmKeepsItsEnergyToSecondOrderThroughBounces) {
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const double dt = k ? 5e-3 : 1e-2;
    const Run r = run(Kind::kArm, options(Integrator::kEnergySafe, dt), {0, 1, 0}, 3);
    error[k] = std::fabs(r.end - r.start);
    CHECK(error[k] < 4 * dt * dt * r.start);
  }
}

TEST(InelasticArmsComeToRestOnTheGroundWithoutGainingEnergy) {
  for (Kind kind : kKinds)
    for (double friction : {0.0, 0.5, 0.8})
      for (double dt : {1e-3, 1e-2}) {
        const Run r = run(kind, options(Integrator::kEnergySafe, dt), {friction, 0, 0}, 3);
        CHECK(r.not_ok == 0);
        CHECK(r.end < r.start);
        CHECK(r.growth < 20 * dt * dt * r.start);
        CHECK(r.deepest < 1e-3);
      }
}

TEST(FrictionWithoutBoundHoldsAndDoesNotSink) {
  for (Integrator integrator : {Integrator::kEnergySafe, Integrator::kSemiImplicit})
    for (double friction : {1e6, 1e200, std::numeric_limits<double>::infinity()}) {
      const Run r = run(Kind::kSlider, options(integrator, 1e-3), {friction, 0, 0}, 1);
      CHECK(r.not_ok == 0);
      CHECK(r.deepest < 1e-2);
    }
}

TEST(AJammedArmReportsItAndStaysBounded) {
  // Restitution asks the tip to leave along the normal while friction wedges it: no exact answer
  // (Painleve).
  for (Kind kind : kKinds)
    for (Integrator integrator : {Integrator::kEnergySafe, Integrator::kSemiImplicit}) {
      const Run r = run(kind, options(integrator, 1e-3), {0.8, 0.3, 0}, 3);
      CHECK(r.fastest < 100);
      CHECK(r.largest_impulse < 1e3);
      CHECK(r.growth < 0.1);
      CHECK(r.deepest < 0.05);
    }
}

TEST(AFixedBaseWithoutJointsHasNoEnergyToBeWrongAbout) {
  ModelBuilder builder("post");
  builder.add_link("base");
  World world;
  Robot& robot = world.add_robot(builder.build(BaseType::kFixed));
  world.step(3);
  CHECK(robot.kinetic_energy() == 0 && robot.mechanical_energy() == 0);
  CHECK(robot.angular_momentum()[0] == 0 && robot.center_of_mass()[2] == 0);
}

TEST(AStepDoesNotHideAContactThatCannotPush) {
  // A slider along the ground that starts in it: nothing moves it out, and the status says so.
  ModelBuilder builder("cart");
  builder.add_link("base");
  Inertial in;
  in.mass = 1, in.inertia = {0.01, 0, 0, 0.01, 0, 0.01};
  builder.add_link("cart", in);
  LinkJoint joint;
  joint.name = "slide", joint.type = LinkJointType::kPrismatic;
  joint.parent = "base", joint.child = "cart", joint.axis = {1, 0, 0};
  builder.add_joint(joint);
  Shape ball;
  ball.size = {0.05, 0, 0};
  builder.add_shape("cart", ball);
  bodies::TwinWorld world(options(Integrator::kEnergySafe, 1e-3));
  world.add_ground();
  RobotOptions where;
  where.position = {0, 0, 0.04};
  const Robot& robot = world.add_robot(builder.build(BaseType::kFixed), where);
  CHECK(world.step() == StepStatus::kNotConverged);
  CHECK(robot.info().contacts == 1 && robot.info().residual > 1e-5);
}

TEST(AllOfThisHeldForBatchesToo) { CHECK(bodies::TwinWorld::compared() > 1000); }
