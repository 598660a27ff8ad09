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

TEST(AHundredThousandEnvironmentsOfAnymalFitIntoAGigabyte) {
  const World world = standing();
  for (const Precision precision : {Precision::kFloat32, Precision::kFloat64}) {
    Batch batch(world, batch_options(1000, precision)), half(world, batch_options(500, precision));
    const double bytes = static_cast<double>(batch.memory_bytes()) / 1000,
                 slope = static_cast<double>(batch.memory_bytes() - half.memory_bytes()) / 500;
    for (const BatchField f : kParameters) batch.array(f);
    const double with_parameters = static_cast<double>(batch.memory_bytes()) / 1000;
    std::printf("  %s: %.0f bytes, %.0f with all parameters\n",
                precision == Precision::kFloat32 ? "float32" : "float64", bytes, with_parameters);
    CHECK(1e5 * bytes < 1e9);
    CHECK(1e5 * with_parameters < 4e9);
    CHECK(bytes > 4 * (19 + 18 + 18 + 12 + 36));  // it counts
    CHECK(slope > 0.5 * bytes);
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
