// A task of the scenes in many environments that are at different times of different episodes, so
// that lanes of a pack fall, land, stand and begin anew side by side.
#pragma once
#include "backend/environments.h"
#include "scenes/tasks.h"

namespace environments {

using scenes::TaskKind;

/// The five tasks whose targets depend on time alone.
constexpr TaskKind kTasks[] = {TaskKind::kStand, TaskKind::kOpenLoopTrot, TaskKind::kHang,
                               TaskKind::kDrop, TaskKind::kRandom};

struct StaggeredTask {
  TaskKind kind;
  int num_envs;
  double time_step = 2e-3;             // [s]
  static constexpr int kRestart = 10;  // steps between the restarts of neighbors
  static constexpr int kHold = 5;      // steps to take at once: between changes of any environment

  const scenes::TaskSpec& spec() const { return scenes::task_spec(kind); }

  World make_world(const ModelPtr& anymal, Integrator integrator) const {
    World world(options(time_step, integrator));
    world.add_ground();
    Robot& robot = world.add_robot(scenes::task_model(kind, anymal));
    const std::vector<double> kp(12, spec().kp), kd(12, spec().kd);
    robot.set_pd_gains(kp, kd);
    return world;
  }

  /// Before step `step`, a multiple of kHold: calls reset(env, state) and target(env, targets)
  /// where there is something to do.
  template <class Reset, class Target>
  void before(int step, Reset&& reset, Target&& target) const {
    for (int env = 0; env < num_envs; ++env) {
      // Each begins in the episode of its number, and in another one after a while.
      const int restart = kRestart * (env + 1);
      const int episode = step < restart ? env : num_envs + env;
      const int done = step < restart ? step : step - restart;
      if (done == 0) {
        State s{std::vector<double>(19), std::vector<double>(18)};
        scenes::initial_state(kind, episode, s.q, s.u);
        reset(env, s);
      }
      std::vector<double> targets(12);
      scenes::pd_target(kind, episode, scenes::target_tick(done, time_step), targets);
      target(env, targets);
    }
  }
};

}  // namespace environments
