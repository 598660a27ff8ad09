// What a step reads of a model and of a world's options. Plain data, the same for every instruction
// set; a lane is an environment (batches) or the only robot (worlds).
#pragma once
#include "collide/ground_shape.h"

namespace stickslip::step {

inline constexpr double kLargestJoint =
    1e9;  // beyond, an angle holds less than seven digits of its turn
inline constexpr double kQuaternionTolerance = 1e-3;  // of a length of one; then it is normalized

/// One robot, as the step sees it. Owned by whoever made the model's layout.
struct RobotTables {
  bool floating;
  int nq, nu, num_joints, num_bodies;
  int num_slots;  // of the tree's layout
  int max_depth;  // joints on the longest path
  int num_shapes, num_points;
  int num_touching;  // links, not body 0, that can touch with several points
  const collide::GroundShape* shapes;
  const int* by_body;                   // the shapes in the order of their bodies
  const double* restitution;            // per shape [1]
  const double* restitution_threshold;  // per shape [m/s]
  const bool* apart;                    // per shape: no joint above it moves more than one point
  const double* foresight;              // per shape: how much of an impulse's change goes on [1]
  const double* damping;                // per joint, viscous
  bool damped;
  const bool* prismatic;                  // per joint
  const dynamics::LinkIndex* body_links;  // per body
  double fixed_position[3];               // of a fixed base, whose q has none
  double fixed_quaternion[4];
};

/// A contact problem written out for the host: G (3n, 3n), c, mu, impulses in and out, velocities
/// out.
struct DenseProblem {
  int contacts;
  double *delassus, *free_velocity, *friction, *impulse, *velocity;
};

/// Contact solvers that are no kernels: the paper's methods, and the chain that finishes what the
/// factored solver leaves.
struct HostSolver {
  struct Effort {
    int sweeps = 0, newton_steps = 0;
    bool solved = false;
    double residual = 0;  // largest of the contacts [m/s]
  };
  void* self = nullptr;
  /// Solves to residuals of at most `tolerance` [m/s] if it can; impulse and velocity hold the
  /// best.
  Effort (*solve)(void* self, DenseProblem& problem, double tolerance) = nullptr;
  bool always = false;   // in place of the factored solver
  int max_contacts = 0;  // larger problems are not given to it
};

/// Reads a clock [s]; kernels have none of their own.
using Clock = double (*)();

/// Seconds per stage, in the order of StageTimes.
enum Stage { kDynamics, kDetection, kDelassus, kSolve, kIntegrate, kNumStages };

struct StepSettings {
  double time_step;
  int max_substeps;
  bool energy_safe;  // integrator
  bool ground;
  double ground_height;
  bool max_dissipation, warm_start;
  double tolerance, relative_tolerance;  // of the factored solver
  HostSolver host;
  Clock clock = nullptr;     // null: not profiled
  double* stages = nullptr;  // (kNumStages)
};

}  // namespace stickslip::step
