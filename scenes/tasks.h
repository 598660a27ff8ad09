// The four tasks of [Hwangbo 2018] section V and the five of benchmarks/compare, each once: initial
// states, targets, gains, resets. Tests, benchmarks and the report all run these.
//
// What an episode does is a pure function of (kind, episode, step), so that another engine can be
// driven through exactly the same work; `Task` applies it to a Robot.
#pragma once
#include <stickslip/world.h>

#include <span>
#include <string>

#include "scenes/trot_controller.h"

namespace stickslip::scenes {

enum class TaskKind {
  kTrot,          ///< trotting at 1.5 m/s with TrotController (paper)
  kHang,          ///< thrown at rest from 1 m, unactuated, only the feet collide (paper, compare)
  kDrop,          ///< thrown at 1 m/s from 1 m, unactuated, until motion dies (paper, compare)
  kRandom,        ///< PD to random targets of 1 rad^2 variance (paper, compare)
  kStand,         ///< PD to the stance (compare)
  kOpenLoopTrot,  ///< PD to an open-loop 2 Hz diagonal gait on the spot (TROT of compare)
};

struct TaskSpec {
  TaskKind kind;
  const char* name;      ///< as in "hang"
  bool collide_torso;    ///< false: use without_base_shapes
  double kp, kd;         ///< of every joint [N m/rad], [N m s/rad]
  double episode;        ///< reset after [s]
  double height;         ///< of the base at the start [m]
  double speed;          ///< forward, of the base at the start [m/s]
  bool moving_targets;   ///< the targets change with time
  bool ends_when_still;  ///< reset when every |u| stayed below 0.05 for 0.2 s
};

/// All tasks, the paper's four first.
std::span<const TaskSpec> task_specs();
const TaskSpec& task_spec(TaskKind kind);
/// Throws ModelError that lists the names.
const TaskSpec& task_spec(const std::string& name);
/// The robot of a task: the given one, or the same without the shapes of its base.
ModelPtr task_model(TaskKind kind, const ModelPtr& anymal);

/// Initial q (19), u (18) of an episode, joints in the order of Model.
void initial_state(TaskKind kind, int episode, std::span<double> q, std::span<double> u);
/// Number of the PD target that holds during step `step` of an episode: one per 10 ms.
int target_tick(long step, double time_step);
/// PD target (12) [rad] at a tick, joints in the order of Model.
void pd_target(TaskKind kind, int episode, int tick, std::span<double> target);

/// Runs episodes of a task on a robot.
class Task {
 public:
  Task(TaskKind kind, double time_step);
  const TaskSpec& spec() const { return *spec_; }
  int episode() const { return episode_; }
  long step() const { return step_; }                 ///< steps done in this episode
  double time() const { return step_ * time_step_; }  ///< in this episode [s]

  /// Puts the robot into the initial state of an episode; sets gains and targets, clears forces.
  void reset(Robot& robot, int episode);
  /// Sets the targets or torques for the step that follows.
  void before_step(Robot& robot);
  /// Counts the step; true when the episode is over.
  bool after_step(const Robot& robot);
  /// One step of the world with both of the above, and the next episode where one is over: returns
  /// whether it was. The world holds this robot only.
  bool advance(World& world, Robot& robot);

 private:
  const TaskSpec* spec_;
  double time_step_;
  TrotController controller_;
  int episode_ = 0;
  long step_ = 0;
  int tick_ = -1;
  double still_ = 0;  // for how long every |u| was small [s]
};

}  // namespace stickslip::scenes
