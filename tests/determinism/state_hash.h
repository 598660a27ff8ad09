// Hashes of states after many steps of known scenes, and of generated contact problems: when a bit
// changes anywhere, one of these does.
#pragma once
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "check.h"
#include "scenes/problem_families.h"
#include "scenes/tasks.h"
#include "step/bodies.h"

namespace state_hash {

using namespace stickslip;

/// FNV-1a over the bytes.
inline std::uint64_t add(std::uint64_t hash, std::span<const double> values) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
  for (size_t k = 0; k < values.size_bytes(); ++k) hash = (hash ^ bytes[k]) * 0x100000001b3u;
  return hash;
}

inline std::uint64_t of(const World& world) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (int k = 0; k < world.num_robots(); ++k) {
    const Robot& r = world.robot(k);
    hash = add(add(hash, r.q()), r.u());
    for (const Contact& c : r.contacts()) hash = add(hash, c.impulse);
  }
  return hash;
}

struct Entry {
  std::string name;
  std::uint64_t hash;
};

inline std::string name(const char* scene, const WorldOptions& o, int steps) {
  char text[120];
  std::snprintf(text, sizeof text, "%s %s %.0fms %d", scene,
                o.integrator == Integrator::kEnergySafe ? "energy_safe" : "semi_implicit",
                1e3 * o.time_step, steps);
  return text;
}

inline Entry task(scenes::TaskKind kind, const ModelPtr& anymal, const WorldOptions& o, int steps) {
  World world(o);
  world.add_ground();
  Robot& robot = world.add_robot(scenes::task_model(kind, anymal));
  scenes::Task task(kind, o.time_step);
  task.reset(robot, 1);
  for (int k = 0; k < steps; ++k) task.advance(world, robot);
  return {name(task.spec().name, o, steps), of(world)};
}

inline Entry trees(const WorldOptions& o, int steps) {
  World world(o);
  world.add_ground();
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const ModelPtr m =
        bodies::tree(seed, {.joints = 5 + static_cast<int>(seed), .shapes = true, .damping = 0.02});
    Robot& robot = world.add_robot(m);
    const bodies::State s = bodies::random_state(*m, seed, 2, 0.6);
    robot.set_state(s.q, s.u);
    robot.set_pd_gains(std::vector<double>(m->num_joints(), 20),
                       std::vector<double>(m->num_joints(), 0.5));
  }
  world.step(steps);
  return {name("trees", o, steps), of(world)};
}

/// The first twenty problems of a family.
inline Entry problems(const scenes::ProblemFamily& family) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const ContactProblem p = family.make(seed);
    hash = add(add(add(hash, p.delassus), p.free_velocity), p.friction);
  }
  return {std::string("problems ") + family.name, hash};
}

inline std::vector<Entry> all(const ModelPtr& anymal) {
  using scenes::TaskKind;
  std::vector<Entry> out;
  for (const Integrator integrator : bodies::kBoth) {
    const WorldOptions o = bodies::options(1e-3, integrator);
    for (const TaskKind kind : {TaskKind::kStand, TaskKind::kHang, TaskKind::kDrop,
                                TaskKind::kRandom, TaskKind::kTrot, TaskKind::kOpenLoopTrot})
      out.push_back(task(kind, anymal, o, 1500));
    out.push_back(trees(o, 500));
  }
  for (const TaskKind kind : {TaskKind::kHang, TaskKind::kDrop, TaskKind::kRandom})
    out.push_back(task(kind, anymal, bodies::options(20e-3), 200));
  for (const SolveMethod method : {SolveMethod::kPerContact, SolveMethod::kPgs}) {
    WorldOptions o = bodies::options(1e-3, Integrator::kSemiImplicit);
    o.solver.method = method;
    o.solver.tolerance = 1e-6;
    Entry e = task(TaskKind::kDrop, anymal, o, 1200);
    e.name += method == SolveMethod::kPgs ? " pgs" : " per_contact";
    out.push_back(e);
  }
  for (const auto& family : scenes::problem_families()) out.push_back(problems(family));
  return out;
}

}  // namespace state_hash
