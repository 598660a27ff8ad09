// Motion without contact: order of the error, invariants, and closed forms of the two integrators.
#include <algorithm>

#include "check.h"
#include "step/twin_world.h"

using namespace bodies;

namespace {

const Vector3 kNone{0, 0, 0}, kDown{0, 0, -kGravity};

ModelPtr anymal() {
  static const ModelPtr model = load_urdf(STICKSLIP_ANYMAL);
  return model;
}

std::vector<ModelPtr> movers(BaseType base = BaseType::kFloating) {
  std::vector<ModelPtr> out;
  if (base == BaseType::kFloating) out.push_back(anymal());
  for (unsigned seed = 1; seed <= 3; ++seed)
    out.push_back(tree(seed, {.joints = 5 + static_cast<int>(seed), .base = base}));
  out.push_back(tree(9, {.joints = 6, .base = base, .prismatic = false, .chain = true}));
  return out;
}

State run(const ModelPtr& model, const State& start, const WorldOptions& o, double duration) {
  TwinWorld world(o);
  Robot& robot = world.add_robot(model);
  robot.set_state(start.q, start.u);
  world.step(static_cast<int>(std::lround(duration / o.time_step)));
  return {copy(robot.q()), copy(robot.u())};
}

/// Quaternions q and -q are the same rotation.
double difference(const Model& m, const State& a, const State& b, bool velocities) {
  if (velocities) return largest_difference(a.u, b.u);
  State c = b;
  if (m.base() == BaseType::kFloating) {
    double same = 0;
    for (int k = 3; k < 7; ++k) same += a.q[k] * b.q[k];
    if (same < 0)
      for (int k = 3; k < 7; ++k) c.q[k] = -c.q[k];
  }
  return largest_difference(a.q, c.q);
}

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

struct Errors {
  double q[4], u[4];  // at 20, 10, 5, 2.5 ms
  double order(const double* e, int k) const { return std::log2(e[k] / e[k + 1]); }
};

/// Median errors of random flights against a step of 0.05 ms.
Errors flight_errors(const ModelPtr& model, const Vector3& gravity, double rate, double duration,
                     int flights) {
  Errors out;
  std::vector<double> q[4], u[4];
  for (int f = 0; f < flights; ++f) {
    const State start = random_state(*model, 100 + f, rate);
    const State truth =
        run(model, start, options(5e-5, Integrator::kEnergySafe, gravity), duration);
    for (int k = 0; k < 4; ++k) {
      const State s =
          run(model, start, options(20e-3 / (1 << k), Integrator::kEnergySafe, gravity), duration);
      q[k].push_back(difference(*model, s, truth, false));
      u[k].push_back(difference(*model, s, truth, true));
    }
  }
  for (int k = 0; k < 4; ++k) out.q[k] = median(q[k]), out.u[k] = median(u[k]);
  return out;
}

void check_second_order(const ModelPtr& model, const Vector3& gravity, double rate,
                        double duration) {
  const Errors e = flight_errors(model, gravity, rate, duration, 5);
  std::printf("  %-8s q error %.1e %.1e %.1e %.1e, order %.2f %.2f %.2f; u order %.2f %.2f %.2f\n",
              model->name().c_str(), e.q[0], e.q[1], e.q[2], e.q[3], e.order(e.q, 0),
              e.order(e.q, 1), e.order(e.q, 2), e.order(e.u, 0), e.order(e.u, 1), e.order(e.u, 2));
  for (int k = 1; k < 3; ++k) {
    CHECK(e.order(e.q, k) > 1.8 && e.order(e.q, k) < 2.2);
    CHECK(e.order(e.u, k) > 1.8 && e.order(e.u, k) < 2.2);
  }
  // From 20 ms the next order may still show.
  CHECK(e.order(e.q, 0) > 1.7 && e.order(e.q, 0) < 2.4);
  CHECK(e.order(e.u, 0) > 1.7 && e.order(e.u, 0) < 2.4);
}

}  // namespace

TEST(FlightErrorIsOfSecondOrderInPositionAndVelocity) {
  for (const ModelPtr& m : movers()) check_second_order(m, kDown, 2, 0.2);
}

TEST(FixedBaseErrorIsOfSecondOrderUnderGravity) {
  for (const ModelPtr& m : movers(BaseType::kFixed)) check_second_order(m, kDown, 1, 0.2);
}

TEST(TheFirstStepAfterSetStateIsAsAccurateAsTheOthers) {
  // One step from a given state: the local error falls with the third power of the step.
  for (const ModelPtr& m : movers()) {
    const State start = random_state(*m, 5, 2);
    double q[2], u[2];
    for (int k = 0; k < 2; ++k) {
      const double h = 8e-3 / (1 << k);
      const State truth = run(m, start, options(h / 64), h), s = run(m, start, options(h), h);
      q[k] = difference(*m, s, truth, false), u[k] = difference(*m, s, truth, true);
    }
    CHECK(q[0] / q[1] > 6.5 && q[0] / q[1] < 9.5);
    CHECK(u[0] / u[1] > 6.5 && u[0] / u[1] < 9.5);
  }
}

TEST(ThePaperStepIsOfFirstOrder) {
  const State start = random_state(*anymal(), 3, 1);
  const State truth = run(anymal(), start, options(5e-5), 0.2);
  double e[2];
  for (int k = 0; k < 2; ++k)
    e[k] = difference(
        *anymal(), run(anymal(), start, options(2e-3 / (1 << k), Integrator::kSemiImplicit), 0.2),
        truth, false);
  CHECK(std::log2(e[0] / e[1]) > 0.85 && std::log2(e[0] / e[1]) < 1.15);
}

TEST(MomentumAndEnergyAreKeptToRoundingWithInternalMotion) {
  for (const double dt : {1e-3, 5e-3, 20e-3})
    for (const ModelPtr& m : movers())
      for (int seed = 0; seed < 3; ++seed) {
        TwinWorld world(options(dt, Integrator::kEnergySafe, kNone));
        Robot& robot = world.add_robot(m);
        const State start = random_state(*m, 40 + seed, 3);
        robot.set_state(start.q, start.u);
        const Vector3 p = robot.linear_momentum(), l = robot.angular_momentum();
        const double energy = robot.mechanical_energy();
        double dp = 0, dl = 0, de = 0;
        for (int k = 0; k < 200; ++k) {
          world.step();
          dp = std::fmax(dp, norm(robot.linear_momentum() - p) / norm(p));
          dl = std::fmax(dl, norm(robot.angular_momentum() - l) / norm(l));
          de = std::fmax(de, std::fabs(robot.mechanical_energy() - energy) / energy);
        }
        CHECK_NEAR(dp, 0, 1e-12);
        CHECK_NEAR(dl, 0, 1e-12);
        CHECK_NEAR(de, 0, 1e-12);
      }
}

TEST(FallingAddsExactlyTheImpulseOfGravity) {
  for (const double dt : {1e-3, 20e-3})
    for (const ModelPtr& m : movers()) {
      TwinWorld world(options(dt, Integrator::kEnergySafe, {1.5, -2.5, -kGravity}));
      Robot& robot = world.add_robot(m);
      const State start = random_state(*m, 60, 3);
      robot.set_state(start.q, start.u);
      const Vector3 p = robot.linear_momentum(), l = robot.angular_momentum(),
                    c = robot.center_of_mass();
      const double energy = robot.mechanical_energy(), mass = m->mass();
      for (int k = 1; k <= 100; ++k) {
        world.step();
        const double t = k * dt;
        const Vector3 now = robot.linear_momentum(), g = world.options().gravity;
        for (int i = 0; i < 3; ++i) CHECK_NEAR(now[i], p[i] + mass * g[i] * t, 1e-11 * mass);
        CHECK_NEAR(norm(robot.angular_momentum() - l), 0, 1e-12 * norm(l));
        // 1e-12 of the kinetic energy that is about: potential and kinetic energy cancel.
        CHECK_NEAR(robot.mechanical_energy(), energy,
                   1e-12 * (robot.kinetic_energy() + std::fabs(robot.potential_energy())));
      }
      // The center of mass follows the parabola only as well as the drift moves the links.
      const double t = 100 * dt;
      Vector3 off = robot.center_of_mass() - c;
      for (int i = 0; i < 3; ++i)
        off[i] -= p[i] / mass * t + 0.5 * world.options().gravity[i] * t * t;
      CHECK(norm(off) < 40 * dt * dt * t);
    }
}

TEST(ABallFollowsTheParabolaExactly) {
  TwinWorld world(options(10e-3));
  Robot& robot = world.add_robot(sphere(0.1, 2));
  const std::vector<double> u{1, -2, 3, 0.3, -0.2, 0.1};
  robot.set_state(base_at(robot.model(), {0, 0, 1}), u);
  for (int k = 1; k <= 100; ++k) {
    world.step();
    const double t = 10e-3 * k;
    CHECK_NEAR(robot.q()[0], t, 1e-13);
    CHECK_NEAR(robot.q()[1], -2 * t, 1e-13);
    CHECK_NEAR(robot.q()[2], 1 + 3 * t - 0.5 * kGravity * t * t, 1e-13);
    CHECK_NEAR(robot.u()[2], 3 - kGravity * t, 1e-13);
    for (int i = 3; i < 6; ++i) CHECK_NEAR(robot.u()[i], u[i], 1e-14);
  }
}

TEST(ThePaperStepFallsAsSemiImplicitEulerDoes) {
  TwinWorld world(options(10e-3, Integrator::kSemiImplicit));
  Robot& robot = world.add_robot(sphere(0.1, 2));
  for (int k = 1; k <= 100; ++k) {
    world.step();
    CHECK_NEAR(robot.u()[2], -kGravity * 1e-2 * k, 1e-13);
    CHECK_NEAR(robot.q()[2], -kGravity * 1e-4 * k * (k + 1) / 2, 1e-13);
  }
}

TEST(ATumblingBodyKeepsItsAngularMomentumAndNearlyItsEnergy) {
  // One rigid body has no internal motion to correct its energy with: the error is of second order
  // and does not pile up.
  const ModelPtr plate = box({0.3, 0.2, 0.05}, 1);
  double worst[2];
  for (int k = 0; k < 2; ++k) {
    const double dt = 10e-3 / (1 << k);
    TwinWorld world(options(dt, Integrator::kEnergySafe, kNone));
    Robot& robot = world.add_robot(plate);
    robot.set_state(base_at(*plate, {0, 0, 0}), std::vector<double>{0, 0, 0, 0.1, 8, 0.1});
    const Vector3 l = robot.angular_momentum();
    const double energy = robot.kinetic_energy();
    worst[k] = 0;
    for (int i = 0; i < 20 / dt; ++i) {
      world.step();
      worst[k] = std::fmax(worst[k], std::fabs(robot.kinetic_energy() / energy - 1));
      CHECK_NEAR(norm(robot.angular_momentum() - l), 0, 1e-12 * norm(l));
    }
  }
  std::printf("  worst relative energy error in 20 s: %.1e at 10 ms, %.1e at 5 ms\n", worst[0],
              worst[1]);
  CHECK(worst[0] < 0.02);
  CHECK(worst[1] < 0.3 * worst[0]);
}

// ---- one joint on a fixed base: the schemes' own recurrences

TEST(APendulumMovesAsVerletOrSymplecticEuler) {
  const double mass = 1.5, reach = 0.4, inertia = 0.02, whole = inertia + mass * reach * reach;
  const double stiffness = mass * kGravity * reach / whole;
  for (const Integrator integrator : kBoth) {
    const double h = 5e-3;
    TwinWorld world(options(h, integrator));
    Robot& robot = world.add_robot(one_joint(LinkJointType::kRevolute, mass, reach, inertia));
    double q = 1.2, u = -0.7;
    robot.set_state(std::vector<double>{q}, std::vector<double>{u});
    for (int k = 0; k < 400; ++k) {
      if (integrator == Integrator::kSemiImplicit) {
        u -= h * stiffness * std::sin(q), q += h * u;
      } else {
        u -= 0.5 * h * stiffness * std::sin(q), q += h * u, u -= 0.5 * h * stiffness * std::sin(q);
      }
      world.step();
      CHECK_NEAR(robot.q()[0], q, 1e-11);
      CHECK_NEAR(robot.u()[0], u, 1e-11);
    }
  }
}

TEST(PeriodOfAPendulumConvergesToTheEllipticIntegral) {
  const double reach = 0.5, inertia = 1e-3, mass = 1, amplitude = 1.5;
  const double omega = std::sqrt(mass * kGravity * reach / (inertia + mass * reach * reach));
  double a = 1, g = std::cos(amplitude / 2);  // 4 K(sin(amplitude/2)) = 2 pi / agm(1, cos)
  for (int k = 0; k < 6; ++k) {
    const double mean = (a + g) / 2;
    g = std::sqrt(a * g), a = mean;
  }
  const double period = 2 * M_PI / (omega * a);
  double error[3];
  for (int k = 0; k < 3; ++k) {
    const double h = 20e-3 / (1 << k);
    TwinWorld world(options(h));
    Robot& robot = world.add_robot(one_joint(LinkJointType::kRevolute, mass, reach, inertia));
    robot.set_state(std::vector<double>{amplitude}, std::vector<double>{0});
    // Ten periods, from the downward crossings of q = 0 by interpolation with u.
    double first = 0, last = 0, before = amplitude;
    for (int crossings = 0, i = 1; crossings < 11; ++i) {
      world.step();
      const double q = robot.q()[0];
      if (before > 0 && q <= 0) {
        const double t = i * h - q / robot.u()[0];
        (crossings++ == 0 ? first : last) = t;
      }
      before = q;
    }
    error[k] = std::fabs((last - first) / 10 - period);
  }
  CHECK(error[0] < 1e-3 * period);
  for (int k = 0; k < 2; ++k)
    CHECK(std::log2(error[k] / error[k + 1]) > 1.8 && std::log2(error[k] / error[k + 1]) < 2.2);
}

TEST(EnergyOfASwingingArmStaysBounded) {
  // 60 s of a chaotic two-link chain and of a random arm. The kicks of gravity on a fixed base keep
  // energy to second order only; the projection keeps what the drift would add.
  for (const ModelPtr& m :
       {tree(11, {.joints = 2, .base = BaseType::kFixed, .prismatic = false, .chain = true}),
        tree(12, {.joints = 6, .base = BaseType::kFixed, .prismatic = false})}) {
    double worst[2];
    for (int k = 0; k < 2; ++k) {
      TwinWorld world(options(5e-3 / (1 << k)));
      Robot& robot = world.add_robot(m);
      const State start = random_state(*m, 8, 1);
      robot.set_state(start.q, start.u);
      const double energy = robot.mechanical_energy();
      worst[k] = 0;
      for (int i = 0; i < 60 / world.options().time_step; ++i) {
        world.step();
        worst[k] = std::fmax(worst[k], std::fabs(robot.mechanical_energy() - energy));
      }
    }
    std::printf("  %s: worst energy error in 60 s %.2e J at 5 ms, %.2e J at 2.5 ms\n",
                m->name().c_str(), worst[0], worst[1]);
    CHECK(worst[0] < 0.5);
  }
}

TEST(ASliderFallsOnTheParabola) {
  for (const Integrator integrator : kBoth) {
    TwinWorld world(options(2e-3, integrator));
    // The axis is tilted: 0.6 across, 0.8 up.
    Robot& robot =
        world.add_robot(one_joint(LinkJointType::kPrismatic, 3, 0.2, 0.01, 0, {0.6, 0, 0.8}));
    robot.set_state(std::vector<double>{0.1}, std::vector<double>{2});
    for (int k = 1; k <= 500; ++k) {
      world.step();
      const double t = 2e-3 * k, a = -0.8 * kGravity;
      const double late = integrator == Integrator::kSemiImplicit ? 0.5 * a * 2e-3 * t : 0;
      CHECK_NEAR(robot.u()[0], 2 + a * t, 1e-12);
      CHECK_NEAR(robot.q()[0], 0.1 + 2 * t + 0.5 * a * t * t + late, 1e-12);
    }
  }
}

TEST(ABarePrismaticPairOscillatesAboutItsCenterOfMass) {
  // Two bodies, a slider between them, a spring by PD gains: implicit in the rates, so each step
  // solves (m + h^2 kp) du = -h kp (x + h u) with the reduced mass m.
  ModelBuilder builder("pair");
  builder.add_link("a", inertial(2, {0.1, 0.1, 0.1}));
  builder.add_link("b", inertial(3, {0.1, 0.1, 0.1}));
  LinkJoint joint;
  joint.name = "slider", joint.parent = "a", joint.child = "b";
  joint.type = LinkJointType::kPrismatic;
  builder.add_joint(joint);
  const ModelPtr pair = builder.build(BaseType::kFloating);
  const double h = 4e-3, kp = 50, reduced = 2.0 * 3 / 5;
  for (const Integrator integrator : kBoth) {
    TwinWorld world(options(h, integrator, kNone));
    Robot& robot = world.add_robot(pair);
    robot.set_pd_gains(std::vector<double>{kp}, std::vector<double>{0});
    std::vector<double> q = base_at(*pair, {0, 0, 0});
    q[7] = 0.2;
    robot.set_state(q, std::vector<double>(7, 0.0));
    const Vector3 c = robot.center_of_mass();
    double x = 0.2, v = 0;
    for (int k = 0; k < 500; ++k) {
      v -= h * kp * (x + h * v) / (reduced + h * h * kp), x += h * v;
      world.step();
      CHECK_NEAR(robot.q()[7], x, 1e-12);
      CHECK_NEAR(robot.u()[6], v, 1e-12);
      CHECK_NEAR(norm(robot.center_of_mass() - c), 0, 1e-13);
      CHECK_NEAR(norm(robot.linear_momentum()), 0, 1e-13);
    }
  }
}

TEST(AllOfThisHeldForBatchesToo) { CHECK(TwinWorld::compared() > 1000); }
