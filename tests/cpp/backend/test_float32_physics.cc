// The closed forms of tests/cpp/step in single precision, with every environment of a batch at
// another point of the same law. What holds to rounding there holds to the rounding of float here.
#include <algorithm>

#include "backend/environments.h"

using namespace environments;

namespace {

constexpr int kEnvs = 12;
constexpr double kStep = 1e-3;  // [s]

/// See tests/cpp/step/test_contact_physics.cc.
double late(Integrator integrator) { return integrator == Integrator::kEnergySafe ? 0.5 : 0; }
double touch(Integrator integrator) { return integrator == Integrator::kEnergySafe ? 0 : -1e-6; }

Batch batch_of(const ModelPtr& model, const WorldOptions& o, const MaterialPair& law = {},
               bool ground = true) {
  World world(o);
  if (ground) world.add_ground();
  world.set_material_pair("default", "default", law);
  world.add_robot(model);
  return Batch(world, batch_options(kEnvs, Precision::kFloat32, 2));
}

float q(Batch& batch, int env, int k) { return row<float>(batch, BatchField::kQ, env)[k]; }
float u(Batch& batch, int env, int k) { return row<float>(batch, BatchField::kU, env)[k]; }

Vector3 impulse(Batch& batch, int env) {
  const auto all = row<float>(batch, BatchField::kContactImpulse, env);
  Vector3 sum{0, 0, 0};
  for (size_t k = 0; k < all.size(); ++k) sum[k % 3] += static_cast<double>(all[k]);
  return sum;
}

const Vector3 kBrick{0.4, 0.3, 0.2};

/// Gravity of an incline, which rises against `azimuth`.
Vector3 tilted(double angle, double azimuth) {
  const double side = kGravity * std::sin(angle);
  return {side * std::cos(azimuth), side * std::sin(azimuth), -kGravity * std::cos(angle)};
}

}  // namespace

TEST(ABallFollowsTheParabola) {
  for (const Integrator integrator : kBoth) {
    const double h = 10e-3;
    Batch batch = batch_of(sphere(0.1, 2), options(h, integrator), {}, false);
    for (int env = 0; env < kEnvs; ++env)
      reset(batch, env, {base_at(batch.model(), {0, 0, 1}), {0.5 * env, -2, 1.0 * env, 1, 2, 3}});
    for (int k = 1; k <= 100; ++k) {
      batch.step();
      const double t = h * k;
      const double fall = integrator == Integrator::kEnergySafe ? t * t : t * (t + h);
      for (int env = 0; env < kEnvs; ++env) {
        CHECK_NEAR(q(batch, env, 0), 0.5 * env * t, 5e-6);
        CHECK_NEAR(q(batch, env, 2), 1 + env * t - 0.5 * kGravity * fall, 3e-5);
        CHECK_NEAR(u(batch, env, 2), env - kGravity * t, 5e-5);  // half an ulp of 10 per step
        CHECK_NEAR(u(batch, env, 4), 2, 1e-5);
      }
    }
  }
}

TEST(PendulumsMoveAsVerletOrSymplecticEuler) {
  const double mass = 1.5, reach = 0.4, inertia = 0.02, whole = inertia + mass * reach * reach;
  const double stiffness = mass * kGravity * reach / whole, h = 5e-3;
  for (const Integrator integrator : kBoth) {
    Batch batch =
        batch_of(one_joint(LinkJointType::kRevolute, mass, reach, inertia), options(h, integrator));
    std::vector<double> angle(kEnvs), rate(kEnvs, -0.7);
    for (int env = 0; env < kEnvs; ++env) {
      angle[env] = 0.1 + 0.15 * env;
      reset(batch, env, {{angle[env]}, {rate[env]}});
    }
    for (int k = 0; k < 400; ++k) {
      batch.step();
      for (int env = 0; env < kEnvs; ++env) {
        double &x = angle[env], &v = rate[env];
        if (integrator == Integrator::kSemiImplicit) {
          v -= h * stiffness * std::sin(x), x += h * v;
        } else {
          v -= 0.5 * h * stiffness * std::sin(x), x += h * v;
          v -= 0.5 * h * stiffness * std::sin(x);
        }
        CHECK_NEAR(q(batch, env, 0), x, 5e-5);
        CHECK_NEAR(u(batch, env, 0), v, 2e-4);
      }
    }
  }
}

TEST(PdControlFollowsItsImplicitRecurrence) {
  const double inertia = 0.3, h = 5e-3, target = 0.8;
  const double gains[][2] = {{40, 1}, {200, 5}, {1e5, 10}, {1e9, 0}, {0, 1e9}, {0, 0}};
  for (const Integrator integrator : kBoth) {
    Batch batch = batch_of(one_joint(LinkJointType::kPrismatic, inertia, 0, 0.1),
                           options(h, integrator, {0, 0, 0}));
    std::vector<double> at(kEnvs, 0), rate(kEnvs, 0.5);
    for (int env = 0; env < kEnvs; ++env) {
      const auto& g = gains[env % 6];
      set_row(batch, BatchField::kKp, env, {&g[0], 1});
      set_row(batch, BatchField::kKd, env, {&g[1], 1});
      set_row(batch, BatchField::kPdTarget, env, {&target, 1});
      reset(batch, env, {{0}, {0.5}});
    }
    for (int k = 0; k < 300; ++k) {
      batch.step();
      for (int env = 0; env < kEnvs; ++env) {
        const double kp = gains[env % 6][0], kd = gains[env % 6][1];
        double &x = at[env], &v = rate[env];
        v += h * (kp * (target - x - h * v) - kd * v) / (inertia + h * kd + h * h * kp), x += h * v;
        CHECK_NEAR(q(batch, env, 0), x, 1e-4);
        CHECK_NEAR(u(batch, env, 0), v, 1e-3);
      }
    }
  }
}

TEST(BlocksSlideWithTheExactAccelerationOrStick) {
  // Even environments lie above the friction angle, odd ones below.
  for (const Integrator integrator : kBoth) {
    Batch batch = batch_of(box(kBrick, 3), options(kStep, integrator));
    std::vector<double> a(kEnvs), azimuth(kEnvs);
    for (int env = 0; env < kEnvs; ++env) {
      const double mu = 0.2 + 0.05 * env, angle = std::atan(mu) + (env % 2 == 0 ? 0.1 : -0.02);
      azimuth[env] = 0.5 * env;
      a[env] = env % 2 == 0 ? kGravity * (std::sin(angle) - mu * std::cos(angle)) : 0;
      set_row(batch, BatchField::kFriction, env, {&mu, 1});
      set_row(batch, BatchField::kGravity, env, tilted(angle, azimuth[env]));
      reset(batch, env,
            {base_at(batch.model(), {0, 0, 0.1 + touch(integrator)}), std::vector<double>(6)});
    }
    for (int n = 1; n <= 500; ++n) {
      batch.step();
      for (int env = 0; env < kEnvs; ++env) {
        const double v = (n - late(integrator)) * kStep * a[env];
        CHECK_NEAR(u(batch, env, 0), v * std::cos(azimuth[env]), 2e-4);
        CHECK_NEAR(u(batch, env, 1), v * std::sin(azimuth[env]), 2e-4);
      }
    }
    for (int env = 1; env < kEnvs; env += 2)
      CHECK_NEAR(std::hypot(q(batch, env, 0), q(batch, env, 1)), 0, 1e-5);
  }
}

TEST(FrictionIsAsStrongInEveryDirection) {
  const double mu = 0.6, mass = 2;
  Batch batch = batch_of(sphere(0.1, mass, 1e6), options(kStep, Integrator::kSemiImplicit), {mu});
  for (int env = 0; env < kEnvs; ++env) {
    const double direction = env * M_PI / 6 + 0.1;
    reset(batch, env,
          {base_at(batch.model(), {0, 0, 0.1 + touch(Integrator::kSemiImplicit)}),
           {std::cos(direction), std::sin(direction), 0, 0, 0, 0}});
  }
  batch.step();
  const double weight = mass * kGravity * kStep;
  for (int env = 0; env < kEnvs; ++env) {
    const double direction = env * M_PI / 6 + 0.1;
    const Vector3 p = impulse(batch, env);
    CHECK_NEAR(p[2], weight, 1e-5 * weight);
    CHECK_NEAR(p[0], -mu * weight * std::cos(direction), 1e-5 * weight);
    CHECK_NEAR(p[1], -mu * weight * std::sin(direction), 1e-5 * weight);
  }
}

TEST(BoxesAtRestCarryTheirWeightAndStay) {
  for (const Integrator integrator : kBoth) {
    Batch batch = batch_of(box(kBrick, 7), options(kStep, integrator));
    std::vector<double> mass(kEnvs);
    for (int env = 0; env < kEnvs; ++env) {
      mass[env] = 1 + 3.0 * env;
      Inertial in = batch.model().bodies()[0].inertial;
      for (double& i : in.inertia) i *= mass[env] / in.mass;
      set_row(batch, BatchField::kBodyMass, env, {&mass[env], 1});
      set_row(batch, BatchField::kBodyInertia, env, in.inertia);
      const double angle = 0.1 * env;
      reset(batch, env,
            {base_at(batch.model(), {0.1 * env, 0, 0.1 + touch(integrator)},
                     {std::cos(angle), 0, 0, std::sin(angle)}),
             std::vector<double>(6)});
    }
    batch.step(2);
    std::vector<std::vector<float>> start;
    for (int env = 0; env < kEnvs; ++env) {
      const auto at = row<float>(batch, BatchField::kQ, env);
      start.emplace_back(at.begin(), at.end());
    }
    for (int k = 0; k < 2000; ++k) {
      batch.step();
      for (int env = 0; env < kEnvs && k % 20 == 0; ++env) {
        const double weight = mass[env] * kGravity * kStep;
        CHECK_NEAR(impulse(batch, env)[2], weight, 1e-4 * weight);
        CHECK_NEAR(std::hypot(impulse(batch, env)[0], impulse(batch, env)[1]), 0, 1e-4 * weight);
      }
    }
    for (int env = 0; env < kEnvs; ++env)
      for (int k = 0; k < 7; ++k) CHECK_NEAR(q(batch, env, k), start[env][k], 2e-5);
  }
}

TEST(SlidingSpheresEndRollingWithFiveSeventhsOfTheirSpeed) {
  for (const Integrator integrator : kBoth) {
    Batch batch = batch_of(sphere(0.1, 2), options(kStep, integrator), {0.3, 0, 0});
    for (int env = 0; env < kEnvs; ++env)
      reset(batch, env,
            {base_at(batch.model(), {0, 0, 0.1 + touch(integrator)}), {0.1 * env, 0, 0, 0, 0, 0}});
    batch.step(700);
    for (int env = 0; env < kEnvs; ++env) {
      CHECK_NEAR(u(batch, env, 0), 5.0 / 7 * 0.1 * env, 1e-4);
      CHECK_NEAR(u(batch, env, 0) - 0.1 * u(batch, env, 4), 0, 2e-5);
      CHECK_NEAR(u(batch, env, 1), 0, 1e-5);
    }
  }
}

TEST(BallsBounceWithTheirRestitution) {
  for (const Integrator integrator : kBoth)
    for (const double e : {0.0, 0.3, 1.0}) {
      Batch batch = batch_of(sphere(0.1, 2), options(kStep, integrator, {0, 0, 0}), {0.5, e, 0});
      for (int env = 0; env < kEnvs; ++env)
        reset(batch, env, {base_at(batch.model(), {0, 0, 0.105}), {0, 0, -2 - 0.1 * env, 0, 0, 0}});
      batch.step(10);
      for (int env = 0; env < kEnvs; ++env) CHECK_NEAR(u(batch, env, 2), e * (2 + 0.1 * env), 5e-6);
    }
}

TEST(MomentumAndEnergyOfAFlightAreKeptToTheRoundingOfFloat) {
  for (const double dt : {1e-3, 5e-3}) {
    const ModelPtr m = tree(3, {.joints = 8});
    const WorldOptions o = options(dt, Integrator::kEnergySafe, {0, 0, 0});
    Batch batch = batch_of(m, o);
    World world(o);  // to ask
    Robot& robot = world.add_robot(m);
    struct Invariants {
      Vector3 p, l;
      double energy;
    };
    const auto invariants = [&](int env) {
      State s;
      for (int k = 0; k < m->nq(); ++k) s.q.push_back(q(batch, env, k));
      for (int k = 0; k < m->nu(); ++k) s.u.push_back(u(batch, env, k));
      robot.set_state(s.q, s.u);
      return Invariants{robot.linear_momentum(), robot.angular_momentum(),
                        robot.mechanical_energy()};
    };
    std::vector<Invariants> start;
    for (int env = 0; env < kEnvs; ++env) {
      reset(batch, env, random_state(*m, 40 + static_cast<unsigned>(env), 3, 5));
      start.push_back(invariants(env));
    }
    for (int call = 0; call < 10; ++call) {
      batch.step(20);
      for (int env = 0; env < kEnvs; ++env) {
        const Invariants now = invariants(env), &then = start[env];
        CHECK_NEAR(norm(now.p - then.p), 0, 2e-5 * norm(then.p));
        CHECK_NEAR(norm(now.l - then.l), 0, 5e-5 * norm(then.l));
        CHECK_NEAR(now.energy, then.energy, 2e-5 * then.energy);
      }
    }
  }
}
