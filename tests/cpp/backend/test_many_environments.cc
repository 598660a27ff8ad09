// What an environment costs in memory, and a hundred thousand of them.
#include "backend/staggered_task.h"

using namespace environments;

#if defined(__SANITIZE_ADDRESS__)
#define SLOWED_DOWN 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SLOWED_DOWN 1
#endif
#endif

namespace {

World standing() {
  return StaggeredTask{TaskKind::kStand, 1}.make_world(load_urdf(STICKSLIP_ANYMAL),
                                                       Integrator::kSemiImplicit);
}

constexpr BatchField kParameters[] = {BatchField::kKp,          BatchField::kKd,
                                      BatchField::kFriction,    BatchField::kGravity,
                                      BatchField::kBodyMass,    BatchField::kBodyCom,
                                      BatchField::kBodyInertia, BatchField::kExternalWrench};

}  // namespace

TEST(AnEnvironmentHoldsTheBytesThatTheDocumentationNames) {
  // docs/theory/batch.md, section 8; of ANYmal also its table and docs/batch.md.
  World world;
  world.add_ground();
  const Model& m = world.add_robot(load_urdf(STICKSLIP_ANYMAL)).model();
  const size_t q = m.nq(), u = m.nu(), joints = m.num_joints(), bodies = m.bodies().size(),
               shapes = m.shapes().size();
  for (const Precision precision : {Precision::kFloat32, Precision::kFloat64}) {
    const bool single = precision == Precision::kFloat32;
    // Whole packs of any width.
    Batch few(world, batch_options(512, precision)), many(world, batch_options(1024, precision));
    const auto bytes = [&] { return (many.memory_bytes() - few.memory_bytes()) / 512; };
    const size_t points = few.contact_points().size(), b = single ? 4 : 8,
                 always = b * (2 * q + 4 * u + joints + 9 * points + 4) + points + 20,
                 parameters = b * (2 * joints + shapes + 3 + 6 * bodies + 30 * bodies);
    CHECK(bytes() == always && always == (single ? 968 : 1904));
    for (const BatchField f : kParameters) few.array(f), many.array(f);
    CHECK(bytes() == always + parameters && bytes() == (single ? 2968 : 5904));
    CHECK(1e5 * static_cast<double>(bytes()) < 1e9);
  }
}

#ifndef SLOWED_DOWN
TEST(AHundredThousandEnvironmentsOfAnymalStep) {
  constexpr int kMany = 100'000;
  Batch batch(standing(), batch_options(kMany, Precision::kFloat32, 2)),
      few(standing(), batch_options(3, Precision::kFloat32));
  CHECK(static_cast<double>(batch.memory_bytes()) < 1e9);
  State s{std::vector<double>(19), std::vector<double>(18)};
  for (int env : {0, 1, 2}) {
    scenes::initial_state(TaskKind::kDrop, env, s.q, s.u);
    for (int place : {env, 50'000 + env, kMany - 3 + env}) reset(batch, place, s);
    reset(few, env, s);
  }
  CHECK(batch.step() == StepStatus::kOk);
  CHECK(few.step() == StepStatus::kOk);
  for (int env : {0, 1, 2})
    for (int place : {env, 50'000 + env, kMany - 3 + env})
      CHECK(same_environment(batch, place, few, env));
  CHECK(same_environment(batch, 3, batch, kMany - 4));
}
#endif
