// What an environment of a batch is given acts on it as on a world of its own, and on no other:
// numbers that are not finite, parameters, wrenches.
#include <stickslip/errors.h>

#include <algorithm>
#include <limits>

#include "backend/thrown_trees.h"

using namespace environments;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                 kInf = std::numeric_limits<double>::infinity();

}  // namespace

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
        const double time = row<double>(batch, BatchField::kTime, kBad)[0];
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

TEST(AContactProblemThatIsRefusedIsReportedAsInItsWorld) {
  for (const Integrator integrator : kBoth) {
    BatchAndWorlds both(
        [&](int) {
          World world(options(1e-3, integrator));
          world.add_ground();
          world.add_robot(sphere(0.1, 2));
          return world;
        },
        batch_options(3));
    for (int env = 0; env < 3; ++env)
      both.reset(env, {base_at(both.of().model(), {0, 0, 0.05}),
                       {0, 0, env == 1 ? -1e20 : -1.0, 0, 0, 0}});
    CHECK(both.step(name(integrator)));
    CHECK(number(both.of(), BatchField::kResidual, 1, 0) == kInf);
    CHECK(status(both.of(), 1) != StepStatus::kOk);
    for (const int env : {0, 2}) CHECK(status(both.of(), env) == StepStatus::kOk);
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

TEST(OptionsThatAreNoneAreRejectedWithWhatTheyMustBe) {
  const World world = thrown_trees()[0].make_world();
  const auto make = [&](auto&& change) {
    BatchOptions o;
    change(o);
    Batch batch(world, o);
  };
  CHECK_THROWS(make([](BatchOptions& o) { o.num_envs = 0; }), ModelError, "num_envs is 0");
  CHECK_THROWS(make([](BatchOptions& o) { o.num_threads = -1; }), ModelError, "num_threads is -1");
  CHECK_THROWS(make([](BatchOptions& o) { o.regroup_every = -1; }), ModelError,
               "regroup_every is -1; it must be 0 (never)");
}
