// The step of a pack of environments as functions behind a table, one per instruction set and
// number format. What goes in and out is plain data, so that code of different instruction sets
// shares it.
#pragma once
#include "lane/lane.h"
#include "step/step_tables.h"

namespace stickslip::backend {

using StatusBits = unsigned int;  // StepStatus
using Flag = unsigned char;       // 0 or 1

/// A robot as kernels of one pack shape see it. T: float or double.
struct PackScene {
  const step::RobotTables* tables;
  int num_bundles, num_slots, num_joints;  // of the layout with PackKernels::bundle_lanes
  const dynamics::Bundle* bundles;
  const dynamics::Slot* slots;
  const void* constants;  // T (slots, 22, lanes of a bundle): LinkConstants
  double base_mass, base_com[3], base_inertia[6];
};

/// A parameter: one row for all environments, or one each. T.
struct Parameter {
  const void* data = nullptr;  // null: none (optional ones only)
  bool per_env = false;
};

/// The arrays of a batch: T unless said, (environments, ...) row-major, padded to whole packs.
struct EnvArrays {
  const int* order;  // (places) the environment at each, see Grouping
  void *q, *u, *generalized_force, *pd_target, *contact_impulse, *residual;
  Flag* contact_active;
  StatusBits* status;
  double* time;
  Parameter kp, kd, friction, gravity;
  Parameter external_wrench;  // optional
  bool force;                 // generalized_force is in use
  bool continues;             // a later part of one call: what was set aside stays so
  void* history;              // T, see PackHistory
};

/// What an environment carries from step to step besides q and u, per pack: T (numbers, lanes).
/// Order: q and u that the last step left, forces of the last solve and the one before, drift
/// acceleration, pending gravity, whether the state is new (1) or of a step (0), whether the
/// environment was set aside (1).
struct PackHistory {
  int q, u, impulse, earlier, drift, pending, fresh, aside, numbers;  // first row of each
  // Inline always: the host and every instruction set call it.
  STICKSLIP_INLINE explicit PackHistory(const step::RobotTables& t)
      : q(0),
        u(t.nq),
        impulse(u + t.nu),
        earlier(impulse + 3 * t.num_points),
        drift(earlier + 3 * t.num_points),
        pending(drift + t.nu),
        fresh(pending + 1),
        aside(fresh + 1),
        numbers(aside + 1) {}
};

/// Mass properties of a pack's environments; null: the model's.
struct PackInertias {
  const void* links = nullptr;  // T (slots, 10, lanes): LinkInertia
  const void* base = nullptr;   // T (10, width): of body 0
};

/// One compiled pack. Every function is free of allocation and of shared state.
struct PackKernels {
  const char* instruction_set;
  bool single;       // float, else double
  int width;         // environments of a pack
  int bundle_lanes;  // of PackScene::constants
  long (*workspace_bytes)(const PackScene&);
  /// Lays a workspace out; aligned to 64.
  void (*prepare)(void* workspace, const PackScene&);
  /// Steps the environments at places first .. first + width - 1; `first` is a multiple of the
  /// width. The same workspace may serve any pack. Returns their status bits, or-ed, those at
  /// places beyond `num_envs` left out.
  StatusBits (*step)(void* workspace, const EnvArrays&, const PackInertias&,
                     const step::StepSettings&, long first, long num_envs, int steps);
};

}  // namespace stickslip::backend
