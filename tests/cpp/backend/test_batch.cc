// Every environment of a batch is a world of its own: in double precision with the bits of one, in
// both precisions whatever its pack, its place, its neighbors and its past are.
#include <algorithm>

#include "backend/staggered_task.h"
#include "backend/thrown_trees.h"

using namespace environments;

namespace {

const ModelPtr& anymal() {
  static const ModelPtr model = load_urdf(STICKSLIP_ANYMAL);
  return model;
}

}  // namespace

TEST(EveryTaskHasTheBitsOfWorldsThroughLandingsAndResets) {
  for (const Integrator integrator : kBoth)
    for (const TaskKind kind : kTasks) {
      const StaggeredTask task{kind, 11};
      BatchAndWorlds both([&](int) { return task.make_world(anymal(), integrator); },
                          batch_options(task.num_envs));
      const std::string where = std::string(task.spec().name) + " " + name(integrator);
      bool equal = true;
      for (int step = 0; step < 300 && equal; ++step) {
        if (step % StaggeredTask::kHold == 0)
          task.before(
              step, [&](int env, const State& s) { both.reset(env, s); },
              [&](int env, const std::vector<double>& t) { both.set_target(env, t); });
        equal = both.step(where.c_str());
        both.count_contacts();
      }
      CHECK(both.contacts > 1000);
    }
}

TEST(ThrownTreesHaveTheBitsOfWorldsWhereLanesTouchInDifferentPoints) {
  long mixed = 0;
  for (const ThrownTree& t : thrown_trees()) {
    BatchAndWorlds both([&](int) { return t.make_world(); }, batch_options(11));
    for (int env = 0; env < 11; ++env) both.reset(env, t.start(env));
    const std::string where = std::string(t.name) + " " + name(t.integrator);
    bool equal = true;
    for (int step = 0; step < 200 && equal; ++step) {
      for (int env = 0; env < 11 && step % 20 == 0; ++env) {
        if (t.gain > 0) both.set_target(env, t.target(env, step));
        if (t.forces) both.set_force(env, t.force(env, step));
      }
      equal = both.step(where.c_str());
      both.count_contacts();
    }
    if (both.contacts < 50) std::printf("  %s: %ld contacts\n", where.c_str(), both.contacts);
    CHECK(both.contacts >= 50);
    mixed += both.mixed;
  }
  std::printf("  bodies with none, one and several contacts in three lanes at once: %ld\n", mixed);
  CHECK(mixed > 1000);
}

TEST(NeitherPackNorPlaceNorNumberOfEnvironmentsShowsInABit) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 6 && t.seed != 11) continue;
      Batch all = crowd(t, batch_options(17, precision), numbers(17));
      for (int call = 0; call < 10; ++call) all.step(20);
      const auto check = [&](const BatchOptions& o, const std::vector<int>& ids) {
        Batch some = crowd(t, o, ids);
        for (int call = 0; call < 10; ++call) some.step(20);
        bool equal = true;
        for (int k = 0; k < o.num_envs; ++k)
          equal = equal && same_environment(some, k, all, ids[k]);
        if (!equal)
          std::printf("  %s %s: %d of %s, width %d\n", t.name, name(t.integrator), o.num_envs,
                      some.instruction_set().c_str(), some.width());
        CHECK(equal);
      };
      for (const PackShape& shape : pack_shapes(precision)) {
        BatchOptions o = batch_options(17, precision);
        o.instruction_set = shape.instruction_set, o.width = shape.width;
        check(o, numbers(17));
      }
      check(batch_options(1, precision), {6});
      check(batch_options(3, precision), {2, 16, 9});
      std::vector<int> turned = numbers(17);
      std::reverse(turned.begin(), turned.end());
      check(batch_options(17, precision, 3), turned);
    }
}

TEST(ManyStepsAtOnceAreStepsOneByOne) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 3) continue;
      Batch many = crowd(t, batch_options(21, precision), numbers(21)),
            one = crowd(t, batch_options(21, precision), numbers(21));
      many.step(150);
      std::vector<double> residual(21);
      std::vector<std::uint32_t> bits(21);
      for (int step = 0; step < 150; ++step) {
        one.step();
        for (int env = 0; env < 21; ++env) {
          residual[env] = std::fmax(residual[env], number(one, BatchField::kResidual, env, 0));
          bits[env] |= static_cast<std::uint32_t>(status(one, env));
        }
      }
      for (int env = 0; env < 21; ++env) {
        CHECK(number(many, BatchField::kResidual, env, 0) == residual[env]);
        CHECK(static_cast<std::uint32_t>(status(many, env)) == bits[env]);
        set_row(one, BatchField::kResidual, env, {&residual[env], 1});
        row<std::uint32_t>(one, BatchField::kStatus, env)[0] = bits[env];
      }
      CHECK(all_same(many, one));
    }
}

// ---- neighbors

TEST(ANeighborThatNeedsSubstepsChangesNobodysContacts) {
  for (const Precision precision : kPrecisions)
    for (const double gain : {0.0, 80.0}) {
      World world(options(5e-3));
      world.add_ground();
      Robot& robot = world.add_robot(anymal());
      State s{std::vector<double>(19), std::vector<double>(18)};
      scenes::initial_state(TaskKind::kStand, 0, s.q, s.u);
      robot.set_state(s.q, s.u);
      robot.set_pd_gains(std::vector<double>(12, gain), std::vector<double>(12, gain / 40));
      robot.set_pd_target(std::span(s.q).subspan(7));
      Batch calm(world, batch_options(16, precision)), batch(world, batch_options(16, precision));
      calm.step(60);
      const std::vector<std::uint8_t> saved = calm.save_state();
      batch.load_state(saved);
      State fast = s;
      fast.q[2] = 5, fast.u[3] = 200;  // so fast that its step is cut, and in the air
      reset(batch, 3, fast);
      int touching = 0;
      for (int call = 0; call < 10; ++call) {
        calm.step(), batch.step();
        for (int env = 0; env < 16; ++env) {
          CHECK(env == 3 || same_environment(batch, env, calm, env));
          const auto active = row<std::uint8_t>(batch, BatchField::kContactActive, env);
          touching += env != 3 && std::count(active.begin(), active.end(), 1) > 0;
        }
      }
      CHECK(touching == 150);
    }
}

// ---- saved states

TEST(AStateSavedByPacksOfOneWidthIsReadByAnother) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 4) continue;
      Batch whole = crowd(t, batch_options(21, precision), numbers(21));
      whole.step(130);
      const std::vector<std::uint8_t> saved = whole.save_state();
      whole.step(70);
      for (const PackShape& shape : pack_shapes(precision)) {
        BatchOptions o = batch_options(21, precision, 2);
        o.instruction_set = shape.instruction_set, o.width = shape.width;
        Batch other = crowd(t, o, numbers(21));
        other.step(33);
        other.load_state(saved);
        CHECK(other.save_state() == saved);
        other.step(70);
        CHECK(all_same(whole, other));
      }
    }
}

TEST(ResetPutsTheWorldsStateBackAndForgetsWhatWas) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 3) continue;
      Batch used = crowd(t, batch_options(6, precision), numbers(6)),
            fresh = crowd(t, batch_options(6, precision), numbers(6));
      used.step(140);
      const std::vector<std::int64_t> all{0, 1, 2, 3, 4, 5};
      used.reset(all, {}, {});
      fresh.reset(all, {}, {});
      CHECK(all_same(used, fresh));
      used.step(140), fresh.step(140);
      CHECK(all_same(used, fresh));
    }
}
