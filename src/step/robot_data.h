// Everything one robot of a world is made of: model, state, control, workspace. The integrators
// work on it.
#pragma once
#include <stickslip/world.h>

#include "collide/ground_shapes.h"
#include "dynamics/bias.h"
#include "dynamics/contact_rows.h"
#include "dynamics/tree_memory.h"
#include "step/contact_stage.h"

namespace stickslip::step {

/// What changes from step to step. Copying it is a snapshot; restoring it replays bit for bit.
struct RobotState {
  std::vector<double> q, u;
  std::vector<double>
      impulse;  // per support point (3), of the last solve, over its step length [N]
  double time = 0;
  // Energy-safe integrator only.
  std::vector<double> drift_acceleration;  // -M^-1 C(q, u) at q: predictor of the next drift
  double pending_gravity =
      0;              // time of gravity not yet in u: half the last step while in contact [s]
  bool fresh = true;  // set from outside: the predictor of the first drift is still to be made
};

/// Forces on the robot, set by the user, kept until changed.
struct RobotControl {
  std::vector<double> generalized_force;  // (nu)
  std::vector<double> kp, kd, target;     // (joints)
  bool pd = false;                        // any gain is not zero
  bool force = false;                     // any generalized force is not zero
};

struct RobotData {
  RobotData(ModelPtr model, const RobotOptions& options);

  ModelPtr model;
  std::string name, material;
  RobotState state, backup;
  RobotControl control;
  dynamics::TreeMemory<double> memory;
  ContactStage contacts;
  StepInfo info;
  std::vector<double> damping;  // viscous, of the joints
  bool damped = false;
  // Pose of a fixed base (its q has none).
  Vec3<double> fixed_position;
  double fixed_quaternion[4];
  // Workspace of the integrators.
  std::vector<double> q_new, u_free, u_plus, rates, implicit, force, delta, gravity_acceleration;
  Vec3<double> contact_origin = zero3<double>();  // base position at the contacts of the last step
  double prepared_step =
      0;  // energy-safe: kinematics and factor are those of state.q for this step length; 0: none

  dynamics::Tree<double>& tree() { return memory.tree(); }
  bool floating() const { return model->base() == BaseType::kFloating; }
  int offset() const { return floating() ? 6 : 0; }  // of the joints in u
  int num_joints() const { return model->num_joints(); }

  const double* base_quaternion(const double* q) const {
    return floating() ? q + 3 : fixed_quaternion;
  }
  const double* joints(const double* q) const { return floating() ? q + 7 : q; }
  Vec3<double> base_position(const double* q) const {
    return floating() ? Vec3<double>{q[0], q[1], q[2]} : fixed_position;
  }
  Vec3<double> linear(const double* u) const {
    return floating() ? Vec3<double>{u[0], u[1], u[2]} : zero3<double>();
  }
  Vec3<double> angular(const double* u) const {
    return floating() ? Vec3<double>{u[3], u[4], u[5]} : zero3<double>();
  }
};

/// What a world tells its robots about a step.
struct StepContext {
  double time_step;
  Vec3<double> gravity;
  bool ground;
  double ground_height;
  const StepSolverOptions* solver;
  int max_substeps;
  StageTimes* times;  // null: not profiled
};

/// q <- q (+) h v: positions and joints add, the base quaternion turns by the exponential map.
void integrate_configuration(const RobotData& robot, double* q, const double* v, double h);

/// Joint-space diagonal that makes damping and PD control implicit over h: h (kd + damping) + h^2
/// kp, docs/theory/step.md (S2). Null if there is none.
const double* implicit_diagonal(RobotData& robot, double h);

/// Generalized force of control over a step h at velocity u: user's force, PD (target - q - h u),
/// damping. False if everything is zero.
bool control_force(RobotData& robot, const double* q, const double* u, double h, double* out);

/// One time step of each integrator. The state only changes if the result is finite.
void step_semi_implicit(RobotData& robot, const StepContext& context);
void step_energy_safe(RobotData& robot, const StepContext& context);

}  // namespace stickslip::step
