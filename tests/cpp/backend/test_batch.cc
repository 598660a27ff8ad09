// Every environment of a batch is a world of its own: in double precision with the bits of one, in
// both precisions whatever its pack, its place and its neighbors are.
#include <algorithm>
#include <limits>

#include "backend/staggered_task.h"

using namespace environments;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                 kInf = std::numeric_limits<double>::infinity();
constexpr Precision kPrecisions[] = {Precision::kFloat32, Precision::kFloat64};

const ModelPtr& anymal() {
  static const ModelPtr model = load_urdf(STICKSLIP_ANYMAL);
  return model;
}

const char* name(Integrator integrator) {
  return integrator == Integrator::kEnergySafe ? "energy_safe" : "semi_implicit";
}

// ---- trees on the ground

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

  ModelPtr model() const { return bodies::tree(seed, tree); }
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

std::vector<ThrownTree> thrown_trees() {
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
    add({"cold starts", 13, {.joints = 6, .shapes = true}, 2e-3, {}, {}, 10, false, cold});
  }
  return out;
}

}  // namespace

TEST(EveryTaskHasTheBitsOfWorldsThroughLandingsAndResets) {
  for (const Integrator integrator : kBoth)
    for (const TaskKind kind : kTasks) {
      const StaggeredTask task{kind, 11};
      BatchAndWorlds both([&](int) { return task.make_world(anymal(), integrator); },
                          batch_options(task.num_envs));
      const std::string where = std::string(task.spec().name) + " " + name(integrator);
      bool equal = true;
      for (int step = 0; step < 300 && equal; ++step) {
        if (step % StaggeredTask::kHold == 0)
          task.before(
              step, [&](int env, const State& s) { both.reset(env, s); },
              [&](int env, const std::vector<double>& t) { both.set_target(env, t); });
        equal = both.step(where.c_str());
        both.count_contacts();
      }
      CHECK(both.contacts > 1000);
    }
}

TEST(ThrownTreesHaveTheBitsOfWorldsWhereLanesTouchInDifferentPoints) {
  long mixed = 0;
  for (const ThrownTree& t : thrown_trees()) {
    BatchAndWorlds both([&](int) { return t.make_world(); }, batch_options(11));
    for (int env = 0; env < 11; ++env) both.reset(env, t.start(env));
    const std::string where = std::string(t.name) + " " + name(t.integrator);
    bool equal = true;
    for (int step = 0; step < 200 && equal; ++step) {
      for (int env = 0; env < 11 && step % 20 == 0; ++env) {
        if (t.gain > 0) both.set_target(env, t.target(env, step));
        if (t.forces) both.set_force(env, t.force(env, step));
      }
      equal = both.step(where.c_str());
      both.count_contacts();
    }
    if (both.contacts < 50) std::printf("  %s: %ld contacts\n", where.c_str(), both.contacts);
    CHECK(both.contacts >= 50);
    mixed += both.mixed;
  }
  std::printf("  bodies with none, one and several contacts in three lanes at once: %ld\n", mixed);
  CHECK(mixed > 1000);
}

namespace {

/// Environment k of the batch is number ids[k] of a crowd.
Batch crowd(const ThrownTree& t, const BatchOptions& o, const std::vector<int>& ids) {
  Batch batch(t.make_world(), o);
  for (int k = 0; k < o.num_envs; ++k) {
    reset(batch, k, t.start(ids[k]));
    if (t.gain > 0) set_row(batch, BatchField::kPdTarget, k, t.target(ids[k], 0));
    if (t.forces) set_row(batch, BatchField::kGeneralizedForce, k, t.force(ids[k], 0));
  }
  return batch;
}

std::vector<int> numbers(int n, int first = 0) {
  std::vector<int> out(n);
  for (int k = 0; k < n; ++k) out[k] = first + k;
  return out;
}

}  // namespace

TEST(NeitherPackNorPlaceNorNumberOfEnvironmentsShowsInABit) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 6 && t.seed != 11) continue;
      Batch all = crowd(t, batch_options(17, precision), numbers(17));
      for (int call = 0; call < 10; ++call) all.step(20);
      const auto check = [&](const BatchOptions& o, const std::vector<int>& ids) {
        Batch some = crowd(t, o, ids);
        for (int call = 0; call < 10; ++call) some.step(20);
        bool equal = true;
        for (int k = 0; k < o.num_envs; ++k)
          equal = equal && same_environment(some, k, all, ids[k]);
        if (!equal)
          std::printf("  %s %s: %d of %s, width %d\n", t.name, name(t.integrator), o.num_envs,
                      some.instruction_set().c_str(), some.width());
        CHECK(equal);
      };
      for (const PackShape& shape : pack_shapes(precision)) {
        BatchOptions o = batch_options(17, precision);
        o.instruction_set = shape.instruction_set, o.width = shape.width;
        check(o, numbers(17));
      }
      check(batch_options(1, precision), {6});
      check(batch_options(3, precision), {2, 16, 9});
      std::vector<int> turned = numbers(17);
      std::reverse(turned.begin(), turned.end());
      check(batch_options(17, precision, 3), turned);
    }
}

TEST(ManyStepsAtOnceAreStepsOneByOne) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 3) continue;
      Batch many = crowd(t, batch_options(9, precision), numbers(9)),
            one = crowd(t, batch_options(9, precision), numbers(9));
      many.step(150);
      std::vector<double> residual(9);
      std::vector<std::uint32_t> bits(9);
      for (int step = 0; step < 150; ++step) {
        one.step();
        for (int env = 0; env < 9; ++env) {
          residual[env] = std::fmax(residual[env], number(one, BatchField::kResidual, env, 0));
          bits[env] |= static_cast<std::uint32_t>(status(one, env));
        }
      }
      for (int env = 0; env < 9; ++env) {
        CHECK(number(many, BatchField::kResidual, env, 0) == residual[env]);
        CHECK(static_cast<std::uint32_t>(status(many, env)) == bits[env]);
        set_row(one, BatchField::kResidual, env, {&residual[env], 1});
        row<std::uint32_t>(one, BatchField::kStatus, env)[0] = bits[env];
      }
      CHECK(all_same(many, one));
    }
}

// ---- environments that are not finite

TEST(WhatIsNotFiniteIsFlaggedAndSetAsideAndNoNeighborNotices) {
  struct Poison {
    BatchField field;
    int k;
    double value;
    bool once;  // a bad state is replaced by the last good one
  };
  const Poison poisons[] = {{BatchField::kQ, 1, kNan, true},
                            {BatchField::kQ, 4, kNan, true},
                            {BatchField::kQ, 3, 0.5, true},  // no unit quaternion
                            {BatchField::kQ, 9, 2e9, true},
                            {BatchField::kU, 7, -kInf, true},
                            {BatchField::kPdTarget, 2, kNan, false},
                            {BatchField::kPdTarget, 2, kInf, false},
                            {BatchField::kGeneralizedForce, 0, kInf, false},
                            {BatchField::kGeneralizedForce, 8, kNan, false},
                            {BatchField::kKp, 1, kNan, false},
                            {BatchField::kKd, 1, kInf, false},
                            {BatchField::kGravity, 2, kNan, false},
                            {BatchField::kBodyMass, 1, kNan, false},
                            {BatchField::kBodyInertia, 6, kInf, false},
                            {BatchField::kExternalWrench, 7, kNan, false}};
  for (const Precision precision : kPrecisions)
    for (const Integrator integrator : kBoth)
      for (const Poison& poison : poisons) {
        ThrownTree t = thrown_trees()[1];
        t.integrator = integrator;
        constexpr int kEnvs = 11, kBad = 5;
        Batch clean = crowd(t, batch_options(kEnvs, precision, 2), numbers(kEnvs)),
              batch = crowd(t, batch_options(kEnvs, precision, 2), numbers(kEnvs));
        clean.array(poison.field);  // parameters of their own in both
        batch.array(poison.field);
        clean.step(120), batch.step(120);
        std::vector<double> q, u;
        for (int k = 0; k < t.tree.joints + 7; ++k)
          q.push_back(number(batch, BatchField::kQ, kBad, k));
        for (int k = 0; k < t.tree.joints + 6; ++k)
          u.push_back(number(batch, BatchField::kU, kBad, k));
        const double time = number(batch, BatchField::kResidual, kBad, 0) * 0 +
                            row<double>(batch, BatchField::kTime, kBad)[0];
        const BatchArray array = batch.array(poison.field);
        if (precision == Precision::kFloat32)
          row<float>(array, kBad)[poison.k] = static_cast<float>(poison.value);
        else
          row<double>(array, kBad)[poison.k] = poison.value;
        for (int call = 0; call < 3; ++call) {
          const StepStatus expected =
              call == 0 || !poison.once ? StepStatus::kNonFinite : StepStatus::kOk;
          const auto bits = static_cast<std::uint32_t>(batch.step(2)) &
                            static_cast<std::uint32_t>(StepStatus::kNonFinite);
          clean.step(2);
          CHECK(bits == static_cast<std::uint32_t>(expected));
          CHECK((status(batch, kBad) == StepStatus::kNonFinite) ==
                (expected == StepStatus::kNonFinite));
          if (expected == StepStatus::kNonFinite) {
            bool kept = row<double>(batch, BatchField::kTime, kBad)[0] == time;
            for (size_t k = 0; k < q.size(); ++k)
              kept = kept && number(batch, BatchField::kQ, kBad, static_cast<int>(k)) == q[k];
            for (size_t k = 0; k < u.size(); ++k)
              kept = kept && number(batch, BatchField::kU, kBad, static_cast<int>(k)) == u[k];
            const auto active = row<std::uint8_t>(batch, BatchField::kContactActive, kBad);
            kept = kept && std::count(active.begin(), active.end(), 0) == long(active.size());
            if (!kept)
              std::printf("  field %d[%d] = %g, %s: the state moved\n",
                          static_cast<int>(poison.field), poison.k, poison.value, name(integrator));
            CHECK(kept);
          }
          bool untouched = true;
          for (int env = 0; env < kEnvs; ++env)
            untouched = untouched && (env == kBad || same_environment(batch, env, clean, env));
          if (!untouched)
            std::printf("  field %d[%d] = %g, %s: a neighbor noticed\n",
                        static_cast<int>(poison.field), poison.k, poison.value, name(integrator));
          CHECK(untouched);
        }
        // After a reset it is as any other.
        if (poison.field == BatchField::kQ) {
          reset(batch, kBad, t.start(3)), reset(clean, kBad, t.start(3));
          batch.step(50), clean.step(50);
          CHECK(same_environment(batch, kBad, clean, kBad));
        }
      }
}

TEST(AForceThatOverflowsLeavesTheStateOfItsWorld) {
  for (const Integrator integrator : kBoth) {
    ThrownTree t = thrown_trees()[1];
    t.integrator = integrator;
    BatchAndWorlds both([&](int) { return t.make_world(); }, batch_options(9));
    for (int env = 0; env < 9; ++env) both.reset(env, t.start(env));
    for (int step = 0; step < 150; ++step) {
      std::vector<double> force(t.tree.joints + 6);
      if (step >= 100 && step < 110) force[4] = 1e300;
      both.set_force(4, force);
      if (!both.step(name(integrator))) break;
      CHECK((status(both.of(), 4) == StepStatus::kNonFinite) == (force[4] > 0));
    }
  }
}

// ---- neighbors

TEST(ANeighborThatNeedsSubstepsChangesNobodysContacts) {
  for (const Precision precision : kPrecisions)
    for (const double gain : {0.0, 80.0}) {
      World world(options(5e-3));
      world.add_ground();
      Robot& robot = world.add_robot(anymal());
      State s{std::vector<double>(19), std::vector<double>(18)};
      scenes::initial_state(TaskKind::kStand, 0, s.q, s.u);
      robot.set_state(s.q, s.u);
      robot.set_pd_gains(std::vector<double>(12, gain), std::vector<double>(12, gain / 40));
      robot.set_pd_target(std::span(s.q).subspan(7));
      Batch calm(world, batch_options(16, precision)), batch(world, batch_options(16, precision));
      calm.step(60);
      const std::vector<std::uint8_t> saved = calm.save_state();
      batch.load_state(saved);
      State fast = s;
      fast.q[2] = 5, fast.u[3] = 200;  // so fast that its step is cut, and in the air
      reset(batch, 3, fast);
      int touching = 0;
      for (int call = 0; call < 10; ++call) {
        calm.step(), batch.step();
        for (int env = 0; env < 16; ++env) {
          CHECK(env == 3 || same_environment(batch, env, calm, env));
          const auto active = row<std::uint8_t>(batch, BatchField::kContactActive, env);
          touching += env != 3 && std::count(active.begin(), active.end(), 1) > 0;
        }
      }
      CHECK(touching == 150);
    }
}

// ---- parameters of their own

namespace {

/// A box on two legs of two links each, feet of two materials.
ModelPtr walker(const std::vector<Inertial>& inertials) {
  ModelBuilder builder("walker");
  int link = 0;
  const auto add_link = [&](const std::string& name) { builder.add_link(name, inertials[link++]); };
  add_link("trunk");
  builder.add_shape("trunk", shape(ShapeType::kBox, {0.5, 0.3, 0.2}));
  for (const std::string side : {"left", "right"}) {
    const auto add_joint = [&](const std::string& name, const std::string& parent,
                               const std::string& child, const Vector3& at, const Vector3& axis) {
      LinkJoint joint;
      joint.name = name, joint.parent = parent, joint.child = child;
      joint.type = LinkJointType::kRevolute;
      joint.pose.position = at;
      joint.axis = axis;
      joint.damping = 0.1;
      builder.add_joint(joint);
    };
    add_link(side + "_thigh");
    add_link(side + "_shank");
    const double y = side == "left" ? 0.2 : -0.2;
    add_joint(side + "_hip", "trunk", side + "_thigh", {0, y, -0.1}, {0.6, 0.8, 0});
    add_joint(side + "_knee", side + "_thigh", side + "_shank", {0, 0, -0.3}, {0, 1, 0});
    Shape foot = shape(ShapeType::kCapsule, {0.04, 0.1, 0}, {0, 0, -0.3});
    foot.material = side;
    builder.add_shape(side + "_shank", foot);
  }
  return builder.build(BaseType::kFloating);
}

/// Bodies 0 to 4 as environment `env` has them; environment 0 has the model's.
std::vector<Inertial> inertials(int env) {
  std::vector<Inertial> out;
  for (int body = 0; body < 5; ++body) {
    Random random(static_cast<unsigned>(env * 10 + body));
    Inertial in = inertial(body == 0 ? 5 : 1, {0.04, 0.05, 0.06});
    in.center_of_mass = {0.01, 0.02, -0.05};
    if (env > 0 && (body + env) % 3 != 0) {  // some bodies stay
      in.mass *= 1 + 0.5 * random.uniform();
      for (double& c : in.center_of_mass) c += 0.03 * random.uniform();
      for (int k : {0, 3, 5}) in.inertia[k] *= 1 + 0.15 * random.uniform();
      for (int k : {1, 2, 4}) in.inertia[k] += 0.003 * random.uniform();
    }
    out.push_back(in);
  }
  return out;
}

void set_inertials(Batch& batch, int env, const std::vector<Inertial>& of_bodies) {
  std::vector<double> mass, com, inertia;
  for (const Inertial& in : of_bodies) {
    mass.push_back(in.mass);
    com.insert(com.end(), in.center_of_mass.begin(), in.center_of_mass.end());
    inertia.insert(inertia.end(), in.inertia.begin(), in.inertia.end());
  }
  set_row(batch, BatchField::kBodyMass, env, mass);
  set_row(batch, BatchField::kBodyCom, env, com);
  set_row(batch, BatchField::kBodyInertia, env, inertia);
}

Vector3 gravity(int env) { return {0.3 * env, -0.2 * env, -9.81 + 0.5 * env}; }
double friction(int env, int shape) { return 0.1 * env + 0.25 * shape; }

void check_walkers(Integrator integrator, bool with_inertias, bool with_the_rest) {
  constexpr int kEnvs = 7;
  const auto make = [&](int env) {
    WorldOptions o = options(2e-3, integrator);
    if (with_the_rest) o.gravity = gravity(env);
    World world(o);
    world.add_ground(0, "street");
    for (int shape = 0; shape < 3; ++shape) {
      const char* materials[] = {"default", "left", "right"};
      world.set_material_pair("street", materials[shape],
                              {friction(with_the_rest ? env : 1, shape), 0, 0});
    }
    Robot& robot = world.add_robot(walker(inertials(with_inertias ? env : 0)));
    const double gain = with_the_rest ? 5.0 * env : 20;
    robot.set_pd_gains(std::vector<double>(4, gain), std::vector<double>(4, gain / 20));
    return world;
  };
  BatchAndWorlds both(make, batch_options(kEnvs));
  Batch& batch = both.of();
  CHECK(batch.contact_shapes() == (std::vector<int>{0, 1, 2}));
  for (int env = 0; env < kEnvs; ++env) {
    if (with_inertias) set_inertials(batch, env, inertials(env));
    if (with_the_rest) {
      const Vector3 g = gravity(env);
      set_row(batch, BatchField::kGravity, env, g);
      const std::vector<double> mu{friction(env, 0), friction(env, 1), friction(env, 2)};
      set_row(batch, BatchField::kFriction, env, mu);
      const Robot& r = both.robot(env);
      set_row(batch, BatchField::kKp, env, r.pd_kp());
      set_row(batch, BatchField::kKd, env, r.pd_kd());
    }
    both.reset(env, random_state(batch.model(), 40 + static_cast<unsigned>(env), 1, 0.8));
  }
  for (int step = 0; step < 400; ++step) {
    if (!both.step(name(integrator))) break;
    both.count_contacts();
  }
  CHECK(both.contacts > 1000);
}

}  // namespace

TEST(MassesAndInertiasOfAnEnvironmentActAsThoseOfAModel) {
  for (const Integrator integrator : kBoth) check_walkers(integrator, true, false);
}

TEST(GravityFrictionAndGainsOfAnEnvironmentActAsThoseOfAWorld) {
  for (const Integrator integrator : kBoth) check_walkers(integrator, false, true);
}

TEST(ParametersMayBeChangedAndPutBackBetweenSteps) {
  for (const Precision precision : kPrecisions)
    for (const Integrator integrator : kBoth) {
      World world(options(2e-3, integrator));
      world.add_ground();
      world.add_robot(walker(inertials(0)));
      Batch plain(world, batch_options(9, precision)), changed(world, batch_options(9, precision));
      for (int env = 0; env < 9; ++env)
        for (Batch* b : {&plain, &changed})
          reset(*b, env, random_state(b->model(), 40 + static_cast<unsigned>(env), 1, 0.8));
      plain.step(100), changed.step(100);
      // What is asked for and has the world's values is no other than what is shared.
      for (const BatchField f :
           {BatchField::kKp, BatchField::kKd, BatchField::kFriction, BatchField::kGravity,
            BatchField::kBodyMass, BatchField::kBodyCom, BatchField::kBodyInertia})
        changed.array(f);
      plain.step(50), changed.step(50);
      CHECK(all_same(plain, changed));
      const std::vector<std::uint8_t> saved = plain.save_state();
      set_inertials(changed, 4, inertials(3));
      changed.step(50), plain.step(50);
      for (int env = 0; env < 9; ++env)
        CHECK(same_environment(plain, env, changed, env) == (env != 4));
      set_inertials(changed, 4, inertials(0));
      for (Batch* b : {&plain, &changed}) b->load_state(saved), b->step(50);
      CHECK(all_same(plain, changed));
    }
}

TEST(AWrenchActsAsTheGeneralizedForceOfItsPoint) {
  // tau = J^T (force, torque) with J of the center of mass, taken anew before every step.
  for (const Integrator integrator : kBoth)
    for (const BaseType base : {BaseType::kFloating, BaseType::kFixed}) {
      const ModelPtr m = tree(33, {.joints = 6, .base = base, .damping = 0.1});
      const int bodies = static_cast<int>(m->bodies().size()), nu = m->nu();
      World world(options(1e-3, integrator));
      Robot& robot = world.add_robot(m);
      constexpr int kEnvs = 5, kOne = 3;
      Batch batch(world, batch_options(kEnvs));
      const State s = random_state(*m, 5, 0.5);
      robot.set_state(s.q, s.u);
      for (int env = 0; env < kEnvs; ++env) reset(batch, env, s);
      std::vector<double> wrench(6 * bodies), jacobian(6 * nu);
      Random random(9);
      for (double& x : wrench) x = random.uniform();
      set_row(batch, BatchField::kExternalWrench, kOne, wrench);
      for (int step = 0; step < 100; ++step) {
        std::vector<double> tau(nu);
        for (int b = 0; b < bodies; ++b) {
          const std::string& frame = m->bodies()[b].name;
          robot.jacobian(frame, jacobian);
          const Matrix3 r = robot.frame_pose(frame).rotation;
          const Vector3& c = m->bodies()[b].inertial.center_of_mass;
          Vector3 arm;
          for (int k = 0; k < 3; ++k)
            arm[k] = r[3 * k] * c[0] + r[3 * k + 1] * c[1] + r[3 * k + 2] * c[2];
          const double *f = &wrench[6 * b], *t = f + 3;
          const double moment[] = {t[0] + arm[1] * f[2] - arm[2] * f[1],
                                   t[1] + arm[2] * f[0] - arm[0] * f[2],
                                   t[2] + arm[0] * f[1] - arm[1] * f[0]};
          for (int j = 0; j < nu; ++j)
            for (int k = 0; k < 3; ++k)
              tau[j] += jacobian[k * nu + j] * f[k] + jacobian[(3 + k) * nu + j] * moment[k];
        }
        robot.set_generalized_force(tau);
        world.step(), batch.step();
        CHECK_NEAR(largest_difference(row<double>(batch, BatchField::kQ, kOne), robot.q()), 0,
                   1e-10);
        CHECK_NEAR(largest_difference(row<double>(batch, BatchField::kU, kOne), robot.u()), 0,
                   1e-9);
      }
      CHECK(largest_difference(row<double>(batch, BatchField::kU, kOne),
                               row<double>(batch, BatchField::kU, kOne - 1)) > 0.1);
      CHECK(same_environment(batch, kOne - 1, batch, 0));
    }
}

// ---- saved states

TEST(AStateSavedByPacksOfOneWidthIsReadByAnother) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 4) continue;
      Batch whole = crowd(t, batch_options(11, precision), numbers(11));
      whole.step(130);
      const std::vector<std::uint8_t> saved = whole.save_state();
      whole.step(70);
      for (const PackShape& shape : pack_shapes(precision)) {
        BatchOptions o = batch_options(11, precision, 2);
        o.instruction_set = shape.instruction_set, o.width = shape.width;
        Batch other = crowd(t, o, numbers(11));
        other.step(33);
        other.load_state(saved);
        CHECK(other.save_state() == saved);
        other.step(70);
        CHECK(all_same(whole, other));
      }
    }
}

TEST(ResetPutsTheWorldsStateBackAndForgetsWhatWas) {
  for (const Precision precision : kPrecisions)
    for (const ThrownTree& t : thrown_trees()) {
      if (t.seed > 3) continue;
      Batch used = crowd(t, batch_options(6, precision), numbers(6)),
            fresh = crowd(t, batch_options(6, precision), numbers(6));
      used.step(140);
      const std::vector<std::int64_t> all{0, 1, 2, 3, 4, 5};
      used.reset(all, {}, {});
      fresh.reset(all, {}, {});
      CHECK(all_same(used, fresh));
      used.step(140), fresh.step(140);
      CHECK(all_same(used, fresh));
    }
}
