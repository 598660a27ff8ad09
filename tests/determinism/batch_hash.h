// Hashes of batches: the tasks in environments at different times of different episodes. How a
// batch is run (pack, threads, places, a snapshot in the middle) must not show in them.
#pragma once
#include "backend/staggered_task.h"
#include "backend/thrown_trees.h"
#include "tests/determinism/state_hash.h"

namespace batch_hash {

using namespace environments;

constexpr int kEnvs = 20, kSteps = 400, kEvery = 100;  // steps between those that are hashed

struct How {
  std::string instruction_set = {};
  int width = 0;
  int threads = 1;
  bool shuffled = false;  // environments in other places, beside other neighbors
  bool reloaded = false;  // saved in the middle and gone on with in a new batch of another pack
  int regroup_every = 16;

  BatchOptions options(Precision precision) const {
    BatchOptions o = batch_options(kEnvs, precision, threads);
    o.instruction_set = instruction_set;
    o.width = width;
    o.regroup_every = regroup_every;
    return o;
  }
  std::string text() const {
    return instruction_set + " width " + std::to_string(width) + ", " + std::to_string(threads) +
           " threads, regrouped every " + std::to_string(regroup_every) +
           (shuffled ? ", shuffled" : "") + (reloaded ? ", reloaded" : "");
  }
};

constexpr std::uint64_t kSeed = 0xcbf29ce484222325u;

template <class T>
std::uint64_t add(std::uint64_t hash, std::span<const T> values) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
  for (size_t k = 0; k < values.size_bytes(); ++k) hash = (hash ^ bytes[k]) * 0x100000001b3u;
  return hash;
}

/// q, u and impulses of an environment.
template <class T>
std::uint64_t add_environment(std::uint64_t hash, std::span<const T> q, std::span<const T> u,
                              std::span<const T> impulse) {
  return add<T>(add<T>(add<T>(hash, q), u), impulse);
}

/// The same of all environments; number env is at place(env).
template <class T, class Place>
std::uint64_t add_environments(std::uint64_t hash, Batch& batch, const Place& place) {
  const BatchArray q = batch.array(BatchField::kQ), u = batch.array(BatchField::kU),
                   impulse = batch.array(BatchField::kContactImpulse);
  for (int env = 0; env < kEnvs; ++env)
    hash = add_environment<T>(hash, row<T>(q, place(env)), row<T>(u, place(env)),
                              row<T>(impulse, place(env)));
  return hash;
}

template <class T>
std::uint64_t of_batch_as(const StaggeredTask& task, const World& world, Precision precision,
                          const How& how) {
  std::vector<Batch> batch;  // the one that runs
  batch.emplace_back(world, how.options(precision));
  const auto place = [&](int env) { return how.shuffled ? (7 * env + 3) % kEnvs : env; };
  std::uint64_t hash = kSeed;
  for (int step = 0; step < kSteps;) {
    if (how.reloaded && step == kSteps / 2) {
      const std::vector<std::uint8_t> saved = batch[0].save_state();
      batch.clear();
      batch.emplace_back(world, batch_options(kEnvs, precision));
      batch[0].load_state(saved);
    }
    task.before(
        step, [&](int env, const State& s) { reset(batch[0], place(env), s); },
        [&](int env, const std::vector<double>& t) {
          set_row(batch[0], BatchField::kPdTarget, place(env), t);
        });
    batch[0].step(StaggeredTask::kHold);
    step += StaggeredTask::kHold;
    if (step % kEvery == 0) hash = add_environments<T>(hash, batch[0], place);
  }
  return hash;
}

inline std::uint64_t of_batch(TaskKind kind, const ModelPtr& anymal, Integrator integrator,
                              Precision precision, const How& how) {
  const StaggeredTask task{kind, kEnvs};
  const World world = task.make_world(anymal, integrator);
  return precision == Precision::kFloat32 ? of_batch_as<float>(task, world, precision, how)
                                          : of_batch_as<double>(task, world, precision, how);
}

/// What a float64 batch must give.
inline std::uint64_t of_worlds(TaskKind kind, const ModelPtr& anymal, Integrator integrator) {
  const StaggeredTask task{kind, kEnvs};
  std::vector<World> worlds;
  for (int env = 0; env < kEnvs; ++env) worlds.push_back(task.make_world(anymal, integrator));
  const std::vector<ContactPoint> points =
      Batch(worlds[0], batch_options(1, Precision::kFloat32)).contact_points();
  std::uint64_t hash = kSeed;
  for (int step = 0; step < kSteps;) {
    task.before(
        step, [&](int env, const State& s) { worlds[env].robot(0).set_state(s.q, s.u); },
        [&](int env, const std::vector<double>& t) { worlds[env].robot(0).set_pd_target(t); });
    for (World& world : worlds) world.step(StaggeredTask::kHold);
    step += StaggeredTask::kHold;
    for (int env = 0; env < kEnvs && step % kEvery == 0; ++env) {
      const Robot& r = worlds[env].robot(0);
      std::vector<double> impulse(3 * points.size());
      for (const Contact& c : r.contacts())
        for (size_t k = 0; k < points.size(); ++k)
          if (points[k].shape == c.shape && points[k].point == c.point)
            std::copy(c.impulse.begin(), c.impulse.end(), impulse.begin() + 3 * k);
      hash = add_environment<double>(hash, r.q(), r.u(), impulse);
    }
  }
  return hash;
}

inline std::string name(TaskKind kind, Integrator integrator, Precision precision) {
  const StaggeredTask task{kind, kEnvs};
  return state_hash::name((std::string("batch ") + task.spec().name).c_str(),
                          options(task.time_step, integrator), kSteps) +
         (precision == Precision::kFloat32 ? " float32" : " float64");
}

/// A crowd in float32, left to itself.
inline state_hash::Entry of_crowd(const ThrownTree& t) {
  Batch batch = crowd(t, How{}.options(Precision::kFloat32), numbers(kEnvs));
  std::uint64_t hash = kSeed;
  for (int step = 0; step < kSteps; step += kEvery) {
    batch.step(kEvery);
    hash = add_environments<float>(hash, batch, [](int env) { return env; });
  }
  const bool floating = t.tree.base == BaseType::kFloating;
  const std::string what =
      std::string("batch of ") + t.name + (floating ? ", floating" : ", fixed");
  return {state_hash::name(what.c_str(), options(t.time_step, t.integrator), kSteps) + " float32",
          hash};
}

/// The float32 batches of golden.txt, by the pack that this machine takes.
inline std::vector<state_hash::Entry> all(const ModelPtr& anymal) {
  std::vector<state_hash::Entry> out;
  for (const ThrownTree& t : thrown_trees())
    if (t.balls) out.push_back(of_crowd(t));  // with links in several contacts
  for (const Integrator integrator : kBoth)
    for (const TaskKind kind : kTasks)
      out.push_back({name(kind, integrator, Precision::kFloat32),
                     of_batch(kind, anymal, integrator, Precision::kFloat32, {})});
  return out;
}

/// Every pack that was built and that this machine has, and for the narrowest of them other numbers
/// of threads where there are `threads`.
inline std::vector<How> ways(Precision precision, bool threads) {
  std::vector<How> out;
  for (const PackShape& shape : pack_shapes(precision)) {
    out.push_back(
        {.instruction_set = shape.instruction_set, .width = shape.width, .regroup_every = 0});
    out.push_back({.instruction_set = shape.instruction_set,
                   .width = shape.width,
                   .threads = 2,
                   .shuffled = true,
                   .reloaded = true,
                   .regroup_every = 3});
  }
  const How narrowest = *std::min_element(
      out.begin(), out.end(), [](const How& a, const How& b) { return a.width < b.width; });
  for (int n = 2; n <= 8 && threads; ++n)
    out.push_back({narrowest.instruction_set, narrowest.width, n});
  return out;
}

}  // namespace batch_hash
