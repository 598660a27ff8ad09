// Many copies of one scene in lockstep: one environment per SIMD lane, threads across packs of
// lanes (docs/theory/batch.md).
//
// Bits of an environment depend on nothing but its own inputs: not on the width of a pack, the
// instruction set, the number of threads, or its neighbors. In double precision they are those of a
// World.
#pragma once
#include <stickslip/world.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace stickslip {

/// Number format of a batch.
enum class Precision { kFloat32, kFloat64 };

/// Options of a batch; fixed once it is made.
struct BatchOptions {
  int num_envs = 1;  ///< >= 1
  Precision precision = Precision::kFloat32;
  /// 0: one per core (hardware thread) that the calling thread may run on, at most one per pack.
  int num_threads = 0;
  /// Binds thread k = 1, 2, ... to core k of those, counted from 0 and over again where they are
  /// fewer; the calling thread, number 0, is left free. Batches that step at the same time share
  /// these cores.
  bool pin_threads = false;
  /// "avx512", "avx2", "neon"; empty: what STICKSLIP_ISA says, else the widest the machine has.
  std::string instruction_set;
  /// Steps, at least, after which environments that touch the ground with the same points are
  /// brought together in packs; up to 16 times as many while little changes. 0: never. Shows in
  /// speed only. >= 0.
  int regroup_every = 16;
  int width = 0;  ///< lanes per pack, for tests; 0: what fills a register
};

/// Arrays of a batch, each (num_envs, ...), row-major, in memory that lives as long as the batch. T
/// is float or double by its precision; joints, bodies, shapes in the order of the Model.
enum class BatchField {
  kQ,                 ///< T (nq), read and written by steps
  kU,                 ///< T (nu), read and written by steps
  kGeneralizedForce,  ///< T (nu) [N, N m], read
  kPdTarget,          ///< T (joints) [rad or m], read
  kContactImpulse,    ///< T (points, 3) on the robot, world axes [N s], of the last substep
  kContactActive,     ///< uint8 (points): it was in the solve of the last substep
  kStatus,            ///< uint32 (): StepStatus bits of the last `step`, or-ed over its steps
  kResidual,          ///< T (): largest contact residual of the last `step` [m/s], see StepInfo
  kTime,              ///< double (): since the last reset [s]
  // Parameters. Shared by all environments until one is asked for: only then each gets its own.
  kKp,           ///< T (joints), >= 0
  kKd,           ///< T (joints), >= 0
  kFriction,     ///< T (contact shapes), >= 0
  kGravity,      ///< T (3) [m/s^2]
  kBodyMass,     ///< T (bodies) [kg]
  kBodyCom,      ///< T (bodies, 3) in the body frame [m]
  kBodyInertia,  ///< T (bodies, 6) xx xy xz yy yz zz about the center of mass, body axes [kg m^2]
  kExternalWrench,  ///< T (bodies, 6) force [N], torque [N m] about the center of mass, world axes
};

enum class NumberType { kFloat32, kFloat64, kUint8, kUint32 };

/// One array of a batch.
struct BatchArray {
  void* data;
  NumberType type;
  std::vector<int> shape;  ///< num_envs first
};

/// A support point that may touch the ground.
struct ContactPoint {
  int body;   ///< of the model
  int shape;  ///< of the model
  int point;  ///< of the shape
};

/// Copies of a world in lockstep. Belongs to one thread at a time; its own threads work inside
/// `step`.
class Batch {
 public:
  /// Takes robot, gravity, ground, materials, options, gains, forces, q and u of `world`; not its
  /// warm start: environments begin as after `reset`. The world must hold exactly one robot and be
  /// solved by kAuto. Throws ModelError that says what a batch cannot hold and what to do.
  Batch(const World& world, const BatchOptions& options);
  ~Batch();
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;

  const Model& model() const;
  ModelPtr model_ptr() const;
  const WorldOptions& world_options() const;
  int num_envs() const;
  Precision precision() const;
  int num_threads() const;
  const std::string& instruction_set() const;  ///< "avx512", "avx2", "neon"
  int width() const;                           ///< lanes of a pack
  const std::vector<ContactPoint>& contact_points() const;
  const std::vector<int>& contact_shapes() const;  ///< of the model, columns of kFriction
  std::size_t memory_bytes() const;                ///< held by the batch now

  /// The array; parameters get their memory on first use. Throws ModelError where memory is short,
  /// or, on first use, where another thread is at work on the batch.
  BatchArray array(BatchField field);

  /// Advances every environment by `steps` time steps; returns the status bits of all, or-ed. An
  /// environment whose inputs or result are not finite is flagged (kNonFinite) and keeps its last
  /// finite state. `go_on`, if given, is asked between parts of a long run whether to go on; where
  /// it says no, the run ends there. Throws ModelError for a negative number, and where another
  /// thread is at work on this batch.
  StepStatus step(int steps = 1, bool (*go_on)() = nullptr);

  /// Puts environments `envs` into states q (envs, nq), u (envs, nu), row-major; empty: the state
  /// that the world had. Forgets warm starts; clears status, residual, impulses and time. Throws
  /// ModelError for an index out of range or twice, wrong lengths, NaN, or a quaternion that is not
  /// near unit length (it is normalized); nothing has changed then.
  void reset(std::span<const std::int64_t> envs, std::span<const double> q,
             std::span<const double> u);

  /// Everything that changes in a step, as bytes; `load_state` replays bit for bit. Inputs and
  /// parameters are not in it. Throws ModelError if the blob is not of such a batch.
  std::vector<std::uint8_t> save_state() const;
  void load_state(std::span<const std::uint8_t> blob);

  void set_profiling(bool on);            ///< counts the time of each stage, a little slower
  const StageTimes& stage_times() const;  ///< seconds of all threads, summed; steps: robot-steps
  void reset_stage_times();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
