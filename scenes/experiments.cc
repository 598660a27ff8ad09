#include "scenes/experiments.h"

#include <algorithm>

#include "scenes/anymal.h"

namespace stickslip::scenes {
namespace {

/// One step of the world between the task's two halves; `look` sees it before a reset forgets it.
template <class Look>
bool step_and_look(Task& task, World& world, Robot& robot, Look&& look) {
  task.before_step(robot);
  world.step();
  look();
  const bool over = task.after_step(robot);
  if (over) task.reset(robot, task.episode() + 1);
  return over;
}

double mean_foot_penetration(const Robot& robot) {
  double sum = 0;
  for (int leg = 0; leg < kNumLegs; ++leg)
    sum += kFootRadius - robot.q()[2] - leg_state(leg, robot.q(), robot.u()).foot[2];
  return sum / kNumLegs;
}

/// Contact i alone: its block of G, and its velocity without its own impulse.
void single_contact(const ProblemSample& sample, int i, double block[9], double velocity[3]) {
  const int rows = 3 * sample.problem.num_contacts();
  for (int r = 0; r < 3; ++r) {
    const double* row = sample.problem.delassus.data() + static_cast<long>(3 * i + r) * rows;
    velocity[r] = sample.problem.free_velocity[3 * i + r];
    for (int k = 0; k < rows; ++k)
      if (k / 3 != i) velocity[r] += row[k] * sample.impulse[k];
    for (int s = 0; s < 3; ++s) block[3 * r + s] = row[3 * i + s];
  }
}

/// Keeps contact i if it slides with the others' impulses held.
void keep_if_sliding(const ProblemSample& sample, int i, SlipSamples& out) {
  double block[9], velocity[3];
  single_contact(sample, i, block, velocity);
  const double mu = sample.problem.friction[i];
  ++out.contacts;
  const SingleContactResult solved =
      solve_contact(block, velocity, mu, {.law = FrictionLaw::kMaxDissipation});
  if (solved.evaluations == 0) return;  // open or sticking
  out.delassus.insert(out.delassus.end(), block, block + 9);
  out.free_velocity.insert(out.free_velocity.end(), velocity, velocity + 3);
  out.friction.push_back(mu);
}

}  // namespace

StepRecord Recorder::step(Task& task, World& world, Robot& robot) {
  StepRecord r;
  r.episode_over = step_and_look(task, world, robot, [&] {
    const StepInfo& info = robot.info();
    r.contacts = info.contacts;
    r.sweeps = info.sweeps;
    r.newton_steps = info.newton_steps;
    r.residual = info.residual;
    r.converged = info.status == StepStatus::kOk;
    r.penetration = mean_foot_penetration(robot);
    r.impact = impact(world, robot);
  });
  if (r.episode_over) pushed_.clear();
  return r;
}

bool Recorder::impact(const World& world, const Robot& robot) {
  constexpr double kImpactSpeed = 0.1;  // [m/s]
  const std::span<const Contact> contacts = robot.contacts();
  bool found = false;
  std::vector<std::pair<int, int>> now;
  for (const Contact& c : contacts)
    if (c.impulse[2] > 0) now.emplace_back(c.shape, c.point);
  if (std::any_of(now.begin(), now.end(), [&](const auto& point) {
        return std::find(pushed_.begin(), pushed_.end(), point) == pushed_.end();
      })) {
    const ContactProblem problem = world.last_contact_problem(0);
    for (std::size_t i = 0; i < contacts.size(); ++i)
      found = found ||
              (contacts[i].impulse[2] > 0 && -problem.free_velocity[3 * i + 2] > kImpactSpeed &&
               std::find(pushed_.begin(), pushed_.end(),
                         std::pair{contacts[i].shape, contacts[i].point}) == pushed_.end());
  }
  pushed_ = std::move(now);
  return found;
}

void sample_slipping(Task& task, World& world, Robot& robot, long wanted, long max_steps,
                     SlipSamples& out) {
  ProblemSample sample;
  const auto full = [&] { return static_cast<long>(out.friction.size()) >= wanted; };
  const auto look = [&] {
    sample.problem = world.last_contact_problem(0, &sample.impulse);
    for (int i = 0; i < sample.problem.num_contacts() && !full(); ++i)
      keep_if_sliding(sample, i, out);
  };
  for (long end = out.steps + max_steps; out.steps < end && !full(); ++out.steps)
    step_and_look(task, world, robot, look);
}

void sample_problems(Task& task, World& world, Robot& robot, long steps, int stride,
                     std::vector<ProblemSample>& out) {
  for (long k = 0; k < steps; ++k)
    step_and_look(task, world, robot, [&] {
      if (k % stride != 0 || robot.info().contacts == 0) return;
      ProblemSample sample;
      sample.problem = world.last_contact_problem(0, &sample.impulse);
      out.push_back(std::move(sample));
    });
}

}  // namespace stickslip::scenes
