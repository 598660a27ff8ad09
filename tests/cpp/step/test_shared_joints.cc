// Contacts that have joints in common: on one link, on links above each other, in any order, on
// floating and fixed bases. A batch beside the world must have its bits (twin_world.h).
#include "check.h"
#include "step/chain.h"
#include "step/twin_world.h"

using namespace bodies;

namespace {

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

TEST(TheOrderOfTheShapesDoesNotShowInABit) {
  for (const BaseType base : kBases)
    for (const Integrator integrator : kIntegrators) {
      World sorted(options(integrator)), mixed(options(integrator));
      Robot &a = put_into(sorted, base, false), &b = put_into(mixed, base, true);
      int compared = 0;
      for (int k = 0; k < 400; ++k) {
        CHECK(sorted.step() == StepStatus::kOk && mixed.step() == StepStatus::kOk);
        compared += a.info().contacts >= 3;
        CHECK(same_bits(a.q(), b.q()) && same_bits(a.u(), b.u()));
      }
      CHECK(compared > 10);
    }
}
