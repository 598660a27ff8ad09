// What the name of an engine says: "mujoco"; "semi_implicit" and "energy_safe", one robot in a
// World; and "batch_float32" and its kin, many robots in a Batch.
#pragma once
#include <stickslip/batch.h>

#include <string>
#include <vector>

#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

enum class EngineKind { kMujoco, kWorld, kBatch };

/// batch_<float32|float64>[_energy_safe][_<instruction set>][_ungrouped][_threads<N>|_apart<N>].
/// Ungrouped: environments stay in the packs that they are put into. With _threads the batch is
/// large and the wall clock counts, also for one thread: that one is what others are compared with.
/// Apart: N >= 2 batches with a share of these robots and one thread each, which know nothing of
/// each other: what the machine gives to N threads.
struct EngineChoice {
  std::string name;
  EngineKind kind = EngineKind::kMujoco;
  Integrator integrator = Integrator::kSemiImplicit;
  Precision precision = Precision::kFloat64;
  std::string instruction_set;  ///< empty: the widest that the machine has
  int threads = 0;              ///< 0: one, without the suffix
  bool apart = false;           ///< the threads belong to as many batches
  bool regroups = true;

  bool wall_clock() const { return threads > 0; }
  /// A contact is solved when its residual is at most this [m/s].
  double tolerance() const { return precision == Precision::kFloat32 ? 1e-5 : 1e-8; }
};

/// Throws std::invalid_argument that says what names there are.
EngineChoice engine_choice(const std::string& name);

/// What is run when nothing is asked for; those that need another processor are left out.
std::vector<std::string> default_engines();

/// What is aimed at: so many times the speed of another engine.
struct Aim {
  std::string against;  ///< empty: compared with nothing
  double ratio = 0;     ///< 0: measured only
};

/// The aim of an engine on a task. `instruction_set`: what a batch runs on.
Aim aim_of(const EngineChoice& engine, const Scenario& scenario,
           const std::string& instruction_set);

}  // namespace stickslip::benchmarks
