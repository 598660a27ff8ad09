// Batches and the worlds that their environments must equal bit for bit.
#pragma once
#include <stickslip/batch.h>

#include <functional>

#include "backend/cpu/instruction_sets.h"
#include "check.h"
#include "step/bodies.h"

namespace environments {

using namespace bodies;

constexpr Precision kPrecisions[] = {Precision::kFloat32, Precision::kFloat64};

inline const char* name(Integrator integrator) {
  return integrator == Integrator::kEnergySafe ? "energy_safe" : "semi_implicit";
}

/// Numbers of one environment: T must be the type of the field.
template <class T>
std::span<T> row(const BatchArray& array, int env) {
  size_t n = 1;
  for (size_t k = 1; k < array.shape.size(); ++k) n *= static_cast<size_t>(array.shape[k]);
  return {static_cast<T*>(array.data) + static_cast<size_t>(env) * n, n};
}
template <class T>
std::span<T> row(Batch& batch, BatchField field, int env) {
  return row<T>(batch.array(field), env);
}

inline double number(Batch& batch, BatchField field, int env, int k) {
  const BatchArray array = batch.array(field);
  return array.type == NumberType::kFloat32 ? static_cast<double>(row<float>(array, env)[k])
                                            : row<double>(array, env)[k];
}
inline void set_row(Batch& batch, BatchField field, int env, std::span<const double> values) {
  const BatchArray array = batch.array(field);
  for (size_t k = 0; k < values.size(); ++k)
    if (array.type == NumberType::kFloat32)
      row<float>(array, env)[k] = static_cast<float>(values[k]);
    else
      row<double>(array, env)[k] = values[k];
}
inline StepStatus status(Batch& batch, int env) {
  return static_cast<StepStatus>(row<std::uint32_t>(batch, BatchField::kStatus, env)[0]);
}

inline void reset(Batch& batch, std::int64_t env, const State& s) {
  batch.reset({&env, 1}, s.q, s.u);
}

/// What a step leaves.
constexpr BatchField kOutputs[] = {BatchField::kQ,
                                   BatchField::kU,
                                   BatchField::kContactImpulse,
                                   BatchField::kContactActive,
                                   BatchField::kStatus,
                                   BatchField::kResidual,
                                   BatchField::kTime};

inline size_t size_of(NumberType type) {
  return type == NumberType::kFloat64 ? 8 : type == NumberType::kUint8 ? 1 : 4;
}

/// Environment `a` of one batch has every bit of environment `b` of another.
inline bool same_environment(Batch& one, int a, Batch& two, int b) {
  for (const BatchField field : kOutputs) {
    const BatchArray x = one.array(field), y = two.array(field);
    const size_t bytes = row<char>(x, 0).size() * size_of(x.type);
    if (x.type != y.type ||
        std::memcmp(static_cast<char*>(x.data) + static_cast<size_t>(a) * bytes,
                    static_cast<char*>(y.data) + static_cast<size_t>(b) * bytes, bytes) != 0)
      return false;
  }
  return true;
}
inline bool all_same(Batch& one, Batch& two) {
  bool same = one.num_envs() == two.num_envs();
  for (int env = 0; env < one.num_envs() && same; ++env)
    same = same_environment(one, env, two, env);
  return same;
}

/// The packs of this machine.
struct PackShape {
  std::string instruction_set;
  int width;
};
inline std::vector<PackShape> pack_shapes(Precision precision) {
  std::vector<PackShape> out;
  for (const char* set : {"avx512", "avx2", "neon"})
    for (const int width : {1, 2, 4, 8, 16})
      if (backend::find_kernels(set, precision == Precision::kFloat32, width))
        out.push_back({set, width});
  return out;
}

inline BatchOptions batch_options(int num_envs, Precision precision = Precision::kFloat64,
                                  int num_threads = 1) {
  BatchOptions o;
  o.num_envs = num_envs;
  o.precision = precision;
  o.num_threads = num_threads;
  o.regroup_every = 3;  // often; it shows nowhere
  return o;
}

/// A float64 batch and one world per environment; whatever is done to an environment is done to its
/// world, and after every step both must have the same bits.
class BatchAndWorlds {
 public:
  using Make = std::function<World(int env)>;

  /// `make`: a world with one robot; the batch is made of that of environment 0.
  BatchAndWorlds(const Make& make, const BatchOptions& options) {
    for (int env = 0; env < options.num_envs; ++env) worlds.push_back(make(env));
    time_.resize(worlds.size());
    batch.emplace_back(worlds[0], options);
  }
  Batch& of() { return batch[0]; }
  Robot& robot(int env) { return worlds[env].robot(0); }
  int num_envs() const { return static_cast<int>(worlds.size()); }

  void reset(int env, const State& s) {
    environments::reset(of(), env, s);
    robot(env).set_state(s.q, s.u);
    time_[env] = 0;
  }
  void set_target(int env, std::span<const double> target) {
    set_row(of(), BatchField::kPdTarget, env, target);
    robot(env).set_pd_target(target);
  }
  void set_force(int env, std::span<const double> force) {
    set_row(of(), BatchField::kGeneralizedForce, env, force);
    robot(env).set_generalized_force(force);
  }

  /// One step of both. False, after the test has failed, where a bit differs.
  bool step(const char* where) {
    std::uint32_t bits = 0;
    for (World& world : worlds) bits |= static_cast<std::uint32_t>(world.step());
    const bool same_status = of().step() == static_cast<StepStatus>(bits);
    CHECK(same_status);
    for (int env = 0; env < num_envs(); ++env)
      if (const char* field = difference(env)) {
        std::printf("  %s: %s of environment %d is not that of its world\n", where, field, env);
        CHECK(!"a batch and its worlds differ");
        return false;
      }
    return same_status;
  }

  /// Support points that took part in the last step, of all environments.
  long contacts = 0;
  /// Steps in which a body had two or more of them in one environment, one in another and none in a
  /// third: what lanes of a pack do not share.
  long mixed = 0;
  void count_contacts() {
    const std::vector<ContactPoint>& points = of().contact_points();
    const int bodies = static_cast<int>(of().model().bodies().size());
    std::vector<bool> none(bodies), one(bodies), several(bodies);
    for (int env = 0; env < num_envs(); ++env) {
      std::vector<int> count(bodies);
      const auto active = row<std::uint8_t>(of(), BatchField::kContactActive, env);
      for (size_t k = 0; k < points.size(); ++k) count[points[k].body] += active[k];
      for (int b = 0; b < bodies; ++b) {
        contacts += count[b];
        (count[b] == 0 ? none : count[b] == 1 ? one : several)[b] = true;
      }
    }
    for (int b = 0; b < bodies; ++b) mixed += none[b] && one[b] && several[b];
  }

  std::vector<World> worlds;
  std::vector<Batch> batch;  // one

 private:
  const char* difference(int env) {
    const Robot& r = robot(env);
    const StepInfo& info = r.info();
    if (info.status != StepStatus::kNonFinite) time_[env] += worlds[env].options().time_step;
    const std::vector<ContactPoint>& points = of().contact_points();
    std::vector<double> impulse(3 * points.size());
    std::vector<std::uint8_t> active(points.size());
    for (const Contact& c : r.contacts())
      for (size_t k = 0; k < points.size(); ++k)
        if (points[k].shape == c.shape && points[k].point == c.point) {
          active[k] = 1;
          std::copy(c.impulse.begin(), c.impulse.end(), impulse.begin() + 3 * k);
        }
    const auto active_here = row<std::uint8_t>(of(), BatchField::kContactActive, env);
    const double residual = row<double>(of(), BatchField::kResidual, env)[0],
                 time = row<double>(of(), BatchField::kTime, env)[0];
    if (!same_bits(row<double>(of(), BatchField::kQ, env), r.q())) return "q";
    if (!same_bits(row<double>(of(), BatchField::kU, env), r.u())) return "u";
    if (!std::equal(active.begin(), active.end(), active_here.begin())) return "contact_active";
    const auto impulse_here = row<double>(of(), BatchField::kContactImpulse, env);
    if (!same_bits(impulse_here, impulse)) return "contact_impulse";
    if (status(of(), env) != info.status) return "status";
    if (!same_bits({&residual, 1}, {&info.residual, 1})) return "residual";
    if (!same_bits({&time, 1}, {&time_[env], 1})) return "time";
    return nullptr;
  }

  std::vector<double> time_;
};

}  // namespace environments
