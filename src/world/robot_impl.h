// What is behind a Robot: its data, and a second workspace for questions, so that asking does not
// disturb the step.
#pragma once
#include "world/robot_data.h"

namespace stickslip {

struct Robot::Impl {
  Impl(ModelPtr model, const RobotOptions& options, const StepSolverOptions& solver);

  /// The query tree with positions and inertias at the present q.
  dynamics::Tree<double>& tree_at_state();
  /// L u at the present q into the query tree.
  void multiply_by_factor(const double* u);
  /// Accelerations (nu) by gravity alone at the present q.
  void gravity_acceleration(double* out);
  /// Of the whole robot: lin [kg m/s], ang about the base origin [kg m^2/s].
  Spatial<double> momentum();
  void collect_contacts();

  world::RobotData data;
  layout::TreeMemory<double> query;
  std::vector<RigidInertia<dynamics::Wide<double>>> scratch;
  std::vector<double> velocity;  // scratch (nu)
  std::vector<Contact> contacts;
  Vec3<double> gravity;
  int index = 0;  // in the world
};

}  // namespace stickslip
