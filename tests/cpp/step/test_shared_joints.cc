// Contacts that have joints in common: on one link, on links above each other, in any order, on
// floating and fixed bases. A batch beside the world must have its bits (twin_world.h).
#include "check.h"
#include "step/twin_world.h"

using namespace bodies;

namespace {

constexpr int kLinks = 7;

/// A chain of short rods with two balls on each of its last three; `interleaved`: the second ball
/// of each is on a frame fixed to it that comes after the next rods, so a model lists the shapes of
/// a body apart.
ModelPtr chain(BaseType base, bool interleaved) {
  ModelBuilder builder("chain");
  Inertial in;
  in.mass = 0.5;
  in.inertia = {2e-3, 0, 0, 2e-3, 0, 2e-3};
  builder.add_link("link0", in);
  for (int k = 1; k <= kLinks; ++k) {
    const std::string id = std::to_string(k), link = "link" + id;
    builder.add_link(link, in);
    LinkJoint joint;
    joint.name = "joint" + id;
    joint.type = LinkJointType::kRevolute;
    joint.parent = "link" + std::to_string(k - 1);
    joint.child = link;
    joint.pose.position = {0.12, 0, 0};
    joint.axis = k % 2 ? Vector3{0, 1, 0} : Vector3{0.3, 0.2, 1};
    builder.add_joint(joint);
    if (k <= kLinks - 3) continue;
    Shape ball;
    ball.size = {0.03, 0, 0};
    ball.pose.position = {0.05, -0.05, 0};
    builder.add_shape(link, ball);
    ball.pose.position = {0.05, 0.05, 0};
    if (interleaved) {
      builder.add_link("side" + id);
      LinkJoint fixed;
      fixed.name = "side_joint" + id;
      fixed.type = LinkJointType::kFixed;
      fixed.parent = link;
      fixed.child = "side" + id;
      builder.add_joint(fixed);
    }
    builder.add_shape(interleaved ? "side" + id : link, ball);
  }
  return builder.build(base);
}

/// Whether the shapes of each body follow each other.
bool body_by_body(const Model& model) {
  int changes = 0;
  for (size_t k = 1; k < model.shapes().size(); ++k)
    changes += model.shapes()[k].body != model.shapes()[k - 1].body;
  return changes == 2;
}

template <class W>
Robot& put_into(W& world, BaseType base, bool interleaved) {
  world.add_ground();
  RobotOptions where;
  where.position = {0, 0, 0.12};
  return world.add_robot(chain(base, interleaved), where);
}

WorldOptions options(Integrator integrator) {
  WorldOptions o;
  o.time_step = 1e-3;
  o.integrator = integrator;
  return o;
}

constexpr BaseType kBases[] = {BaseType::kFloating, BaseType::kFixed};
constexpr Integrator kIntegrators[] = {Integrator::kSemiImplicit, Integrator::kEnergySafe};

}  // namespace

TEST(TheTwoChainsDifferInTheOrderOfTheirShapes) {
  CHECK(body_by_body(*chain(BaseType::kFixed, false)));
  CHECK(!body_by_body(*chain(BaseType::kFixed, true)));
}

TEST(LanesHaveTheBitsOfAWorldInAnyOrderOfTheShapes) {
  for (const BaseType base : kBases)
    for (const Integrator integrator : kIntegrators)
      for (const bool interleaved : {false, true}) {
        TwinWorld world(options(integrator));
        const Robot& robot = put_into(world, base, interleaved);
        int most_contacts = 0;
        for (int k = 0; k < 400; ++k) {
          CHECK(world.step() == StepStatus::kOk);
          most_contacts = std::max(most_contacts, robot.info().contacts);
        }
        CHECK(most_contacts >= 5);
      }
  CHECK(TwinWorld::compared() == 8 * 400);
}

TEST(WithoutFrictionTheOrderOfTheShapesDoesNotShow) {  // whose velocities are unique
  for (const BaseType base : kBases)
    for (const Integrator integrator : kIntegrators) {
      World sorted(options(integrator)), mixed(options(integrator));
      Robot &a = put_into(sorted, base, false), &b = put_into(mixed, base, true);
      for (World* world : {&sorted, &mixed})
        world->set_material_pair("default", "default", {0, 0, 0});
      int compared = 0;
      double apart = 0;
      for (int k = 0; k < 400; ++k) {
        // From the same state in each step, since what they do is chaotic.
        const State s{copy(a.q()), copy(a.u())};
        a.set_state(s.q, s.u);
        b.set_state(s.q, s.u);
        CHECK(sorted.step() == StepStatus::kOk && mixed.step() == StepStatus::kOk);
        compared += a.info().contacts >= 3;
        apart = std::max(apart, largest_difference(a.u(), b.u()));
      }
      std::printf("  %d steps with three contacts or more, apart by %.1e\n", compared, apart);
      CHECK(compared > 10);
      CHECK_NEAR(apart, 0, 1e-6);
    }
}
