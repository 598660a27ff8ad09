// One task in one world, for the physics tests.
#pragma once
#include <stickslip/world.h>

#include "check.h"
#include "scenes/statistics.h"
#include "scenes/tasks.h"

namespace scene {

using namespace stickslip;
using namespace stickslip::scenes;

inline const ModelPtr& anymal() {
  static const ModelPtr model = load_urdf(STICKSLIP_ANYMAL);
  return model;
}

inline WorldOptions options(double time_step, Integrator integrator = Integrator::kEnergySafe) {
  WorldOptions o;
  o.time_step = time_step;
  o.integrator = integrator;
  return o;
}

struct Scene {
  World world;
  Robot& robot;
  Task task;
  Scene(TaskKind kind, const WorldOptions& o, int episode = 0)
      : world(o), robot(add(world, kind)), task(kind, o.time_step) {
    task.reset(robot, episode);
  }

 private:
  static Robot& add(World& world, TaskKind kind) {
    world.add_ground();
    return world.add_robot(task_model(kind, anymal()));
  }
};

/// Runs whole episodes 0..episodes-1 and collects what they showed.
inline Statistics run_episodes(TaskKind kind, const WorldOptions& o, int episodes,
                               bool track_energy = false) {
  Scene s(kind, o);
  Statistics statistics(o, 2.0, track_energy);
  for (int e = 0; e < episodes; ++e) {
    s.task.reset(s.robot, e);
    statistics.begin(s.robot);
    bool over = false;
    while (!over) {
      s.task.before_step(s.robot);
      s.world.step();
      over = s.task.after_step(s.robot);
      statistics.observe(s.robot);
    }
  }
  return statistics;
}

}  // namespace scene
