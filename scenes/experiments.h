// What the report of the paper's experiments samples while a task runs: the effort and the
// penetration of every step, sliding contacts, whole contact problems.
#pragma once
#include <stickslip/world.h>

#include <vector>

#include "scenes/tasks.h"

namespace stickslip::scenes {

/// One step of a task.
struct StepRecord {
  int contacts = 0, sweeps = 0, newton_steps = 0;
  double residual = 0;     ///< [m/s]
  double approach = 0;     ///< fastest approach of a contact, were there no impulses [m/s]
  double penetration = 0;  ///< of the four feet, mean; negative above the ground [m]
  bool converged = true;   ///< the solve reached its tolerance
  bool episode_over = false;
};

/// Sliding contacts, each as a problem of its own: the other contacts' impulses belong to the free
/// velocity ([Hwangbo 2018] eq. 5).
struct SlipSamples {
  std::vector<double> delassus;       ///< (k, 3, 3) [1/kg]
  std::vector<double> free_velocity;  ///< (k, 3) [m/s]
  std::vector<double> friction;       ///< (k) [1]
  long steps = 0, contacts = 0;       ///< that were looked at
};

/// A contact problem that a step met, with the impulses it found.
struct ProblemSample {
  ContactProblem problem;
  std::vector<double> impulse;  ///< (3n) [N s]
};

/// Takes one step and says what it did. The world holds this robot only, as in all below.
StepRecord record_step(Task& task, World& world, Robot& robot);

/// Steps until `wanted` sliding contacts were added to `out`, at most `max_steps` steps.
void sample_slipping(Task& task, World& world, Robot& robot, long wanted, long max_steps,
                     SlipSamples& out);

/// Takes `steps` steps and adds the problem of every `stride`-th one that has contacts.
void sample_problems(Task& task, World& world, Robot& robot, long steps, int stride,
                     std::vector<ProblemSample>& out);

}  // namespace stickslip::scenes
