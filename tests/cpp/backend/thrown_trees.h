// Trees that are thrown at the ground, and crowds of them in a batch: lanes of a pack touch in
// different points.
#pragma once
#include "backend/environments.h"
#include "step/chain.h"

namespace environments {

/// A tree that is thrown at the ground, each environment from another state.
struct ThrownTree {
  const char* name;
  unsigned seed;
  TreeOptions tree;
  double time_step;  // [s]
  Integrator integrator;
  MaterialPair law;
  double gain = 0;  // kp, kd = gain / 20
  bool forces = false;
  StepSolverOptions solver = {};

  bool balls = false;  // the chain whose shapes are interleaved, in place of a tree

  ModelPtr model() const {
    return balls ? bodies::chain(tree.base, true) : bodies::tree(seed, tree);
  }
  World make_world() const {
    WorldOptions o = options(time_step, integrator);
    o.solver = solver;
    World world(o);
    world.add_ground(0.1);
    world.set_material_pair("default", "default", law);
    Robot& robot = world.add_robot(model(), {.name = "tree", .position = {0.1, 0.2, 0.25}});
    const int joints = robot.model().num_joints();
    robot.set_pd_gains(std::vector<double>(joints, gain), std::vector<double>(joints, gain / 20));
    return world;
  }
  State start(int env) const {
    return random_state(*model(), 100 * seed + static_cast<unsigned>(env), 2, 0.25 + 0.05 * env);
  }
  std::vector<double> target(int env, int step) const {
    Random random(1000 * static_cast<unsigned>(env) + static_cast<unsigned>(step / 20));
    std::vector<double> out(tree.joints);
    for (double& x : out) x = 0.5 * random.uniform();
    return out;
  }
  std::vector<double> force(int env, int step) const {
    Random random(77 + 1000 * static_cast<unsigned>(env) + static_cast<unsigned>(step / 20));
    std::vector<double> out(tree.joints + (tree.base == BaseType::kFloating ? 6 : 0));
    for (double& x : out) x = env % 3 == 0 ? 0 : random.uniform();  // some have none
    return out;
  }
};

inline std::vector<ThrownTree> thrown_trees() {
  std::vector<ThrownTree> out;
  StepSolverOptions dissipative;
  dissipative.law = FrictionLaw::kMaxDissipation;
  StepSolverOptions cold;
  cold.warm_start = false;
  for (const Integrator integrator : kBoth) {
    const auto add = [&](ThrownTree t) {
      t.integrator = integrator;
      out.push_back(t);
    };
    add({"sliders", 1, {.joints = 6, .shapes = true}, 1e-3, {}, {}});
    add({"chain, damped, driven",
         2,
         {.joints = 9, .prismatic = false, .shapes = true, .chain = true, .damping = 0.05},
         2e-3,
         {},
         {0.5, 0, 0},
         20});
    add({"large steps",
         3,
         {.joints = 7, .prismatic = false, .shapes = true, .damping = 0.02},
         20e-3,
         {},
         {0.8, 0, 0},
         5});
    add({"bouncing", 4, {.joints = 4, .shapes = true}, 2e-3, {}, {0.3, 0.6, 0.1}, 0, true});
    add({"many branches", 5, {.joints = 14, .shapes = true}, 2e-3, {}, {1.2, 0, 0}, 10, true});
    add({"fixed base",
         6,
         {.joints = 8, .base = BaseType::kFixed, .shapes = true, .damping = 0.1},
         2e-3,
         {},
         {0.6, 0.2, 0},
         8});
    add({"fixed base without drives",
         18,
         {.joints = 5, .base = BaseType::kFixed, .prismatic = false, .shapes = true},
         2e-3,
         {},
         {},
         0,
         true});
    add({"without friction", 7, {.joints = 5, .shapes = true}, 2e-3, {}, {0, 0, 0}});
    add({"one body", 11, {.joints = 0, .shapes = true}, 2e-3, {}, {0.7, 0.3, 0}});
    add({"most dissipation",
         12,
         {.joints = 6, .shapes = true},
         2e-3,
         {},
         {},
         10,
         false,
         dissipative});
    for (const BaseType base : {BaseType::kFloating, BaseType::kFixed}) {
      ThrownTree chain{
          "interleaved balls", 6, {.joints = bodies::kLinks, .base = base}, 1e-3, {}, {}};
      chain.balls = true;
      add(chain);
    }
    add({"cold starts", 13, {.joints = 6, .shapes = true}, 2e-3, {}, {}, 10, false, cold});
  }
  return out;
}

/// Environment k of the batch is number ids[k] of a crowd.
inline Batch crowd(const ThrownTree& t, const BatchOptions& o, const std::vector<int>& ids) {
  Batch batch(t.make_world(), o);
  for (int k = 0; k < o.num_envs; ++k) {
    reset(batch, k, t.start(ids[k]));
    if (t.gain > 0) set_row(batch, BatchField::kPdTarget, k, t.target(ids[k], 0));
    if (t.forces) set_row(batch, BatchField::kGeneralizedForce, k, t.force(ids[k], 0));
  }
  return batch;
}

/// 0, 1, ... n - 1.
inline std::vector<int> numbers(int n) {
  std::vector<int> out(n);
  for (int k = 0; k < n; ++k) out[k] = k;
  return out;
}

}  // namespace environments
