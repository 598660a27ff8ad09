// Everything one robot of a world is made of: model, state, control, workspace.
#pragma once
#include <stickslip/world.h>

#include "layout/tree_memory.h"
#include "step/robot_lanes.h"
#include "world/host_solver.h"
#include "world/robot_scene.h"

namespace stickslip::world {

/// What changes from step to step. Copying it is a snapshot; restoring it replays bit for bit.
struct RobotState {
  std::vector<double> q, u;
  std::vector<double>
      impulse;  // per support point (3), of the last solve, over its step length [N]
  double time = 0;
  // Semi-implicit integrator only.
  std::vector<double> earlier_impulse;  // of the solve before
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
  std::vector<double> damping;            // (joints) kd and the joint's own
  bool pd = false;                        // any gain is not zero
  bool force = false;                     // any generalized force is not zero
};

struct RobotData {
  RobotData(ModelPtr model, const RobotOptions& options, const StepSolverOptions& solver);

  ModelPtr model;
  std::string name, material;
  RobotOptions options;
  RobotState state;
  RobotControl control;
  layout::TreeMemory<double> memory;
  RobotScene scene;
  SolverOnHost host;
  step::RobotLanes<double> lanes;  // one lane: this robot
  StepInfo info;

  const step::ContactStage<double>& contacts() const { return lanes.contacts; }
  /// The last step's contacts and workspace no longer belong to the state.
  void forget_step();
  bool floating() const { return scene.tables().floating; }
  int offset() const { return floating() ? 6 : 0; }  // of the joints in u
  int num_joints() const { return model->num_joints(); }
  const double* base_quaternion(const double* q) const {
    return floating() ? q + 3 : scene.tables().fixed_quaternion;
  }
  const double* joints(const double* q) const { return lanes.joints(q); }
  Vec3<double> base_position(const double* q) const { return lanes.base_position(q); }
  Vec3<double> linear(const double* u) const { return lanes.linear(u); }
  Vec3<double> angular(const double* u) const { return lanes.angular(u); }

  /// One time step. The state only changes if the result is finite.
  void step(step::StepSettings settings, const Vec3<double>& gravity);

 private:
  AlignedBlock block_;  // of the lanes
};

}  // namespace stickslip::world
