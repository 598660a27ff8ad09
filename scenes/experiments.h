// What the report of the paper's experiments samples while a task runs: the effort and the
// penetration of every step, sliding contacts, whole contact problems.
#pragma once
#include <stickslip/world.h>

#include <utility>
#include <vector>

#include "scenes/tasks.h"

namespace stickslip::scenes {

/// One step of a task.
struct StepRecord {
  int contacts = 0, sweeps = 0, newton_steps = 0;
  double residual = 0;     ///< [m/s]
  double penetration = 0;  ///< of the four feet, mean; negative above the ground [m]
  bool impact = false;     ///< a point pushed that did not before and came in faster than 0.1 m/s
  bool converged = true;   ///< the solve reached its tolerance
  bool episode_over = false;
};

/// Takes steps and says what each did. The world holds this robot only, as in all below.
class Recorder {
 public:
  StepRecord step(Task& task, World& world, Robot& robot);

 private:
  bool impact(const World& world, const Robot& robot);
  std::vector<std::pair<int, int>> pushed_;  // shape and point, in the step before
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

/// Steps until `wanted` contacts that slide, once the problem is solved, are in `out`; at most
/// `max_steps` steps.
void sample_slipping(Task& task, World& world, Robot& robot, long wanted, long max_steps,
                     SlipSamples& out);

/// Takes `steps` steps and adds the problem of every `stride`-th one that has contacts.
void sample_problems(Task& task, World& world, Robot& robot, long steps, int stride,
                     std::vector<ProblemSample>& out);

}  // namespace stickslip::scenes
