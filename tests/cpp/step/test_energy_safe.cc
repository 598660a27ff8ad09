// What the default integrator promises: contacts give no energy, overlap goes, links that turn far
// cut the step, forces act exactly, no gain is too stiff.
#include <algorithm>

#include "check.h"
#include "step/twin_world.h"

using namespace bodies;

namespace {

struct Throw {
  double growth = 0;    // largest rise of energy above its running minimum [J]
  double fastest = 0;   // [rad/s, m/s]
  double overlap = 0;   // largest at the start of a step, after the landing [m]
  double substeps = 0;  // mean
  bool finite = true;
};

Throw throw_tree(const ModelPtr& model, unsigned seed, double rate, double dt, double duration) {
  TwinWorld world(options(dt));
  if (seed % 5 != 0) world.go_alone();  // a pack of these takes long
  world.add_ground();
  Robot& robot = world.add_robot(model);
  const State s = random_state(*model, seed, rate, 1.0);
  robot.set_state(s.q, s.u);
  Throw out;
  double least = robot.mechanical_energy();
  const int steps = static_cast<int>(duration / dt);
  for (int k = 0; k < steps; ++k) {
    world.step();
    const double energy = robot.mechanical_energy();
    out.growth = std::fmax(out.growth, energy - least);
    least = std::fmin(least, energy);
    out.fastest = std::fmax(out.fastest, largest(robot.u()));
    out.finite =
        out.finite && std::isfinite(energy) && robot.info().status != StepStatus::kNonFinite;
    out.substeps += static_cast<double>(robot.info().substeps) / steps;
  }
  for (const Contact& c : robot.contacts()) out.overlap = std::fmax(out.overlap, -c.gap);
  return out;
}

ModelPtr thrown_tree(unsigned seed) {
  return tree(seed, {.joints = 6 + static_cast<int>(seed % 5),
                     .prismatic = false,
                     .shapes = true,
                     .chain = seed % 2 == 0});
}

double joint_rates(const Robot& r) { return largest(r.u().subspan(6)); }

}  // namespace

TEST(ThrownTreesNeitherExplodeNorGainEnergyAt20Milliseconds) {
  for (const double rate : {3.0, 10.0, 20.0}) {
    Throw worst;
    double overlap = 0;
    for (unsigned seed = 0; seed < 60; ++seed) {
      const Throw t = throw_tree(thrown_tree(seed), seed, rate, 20e-3, 3);
      if (!t.finite || t.growth > 0.05 || t.fastest > 1000)
        std::printf("  seed %u: growth %.3g J, fastest %.0f, %s\n", seed, t.growth, t.fastest,
                    t.finite ? "finite" : "not finite");
      CHECK(t.finite);
      worst.growth = std::fmax(worst.growth, t.growth);
      worst.fastest = std::fmax(worst.fastest, t.fastest);
      worst.substeps += t.substeps / 60;
      overlap = std::fmax(overlap, t.overlap);
    }
    std::printf(
        "  %2.0f rad/s: energy growth at most %.1e J, velocity at most %.0f, %.2f substeps, "
        "overlap "
        "after 3 s at most %.1e m\n",
        rate, worst.growth, worst.fastest, worst.substeps, overlap);
    CHECK(worst.growth < 0.05);
    CHECK(worst.fastest < 2000);  // a light link may be whipped; energy says whether it exploded
  }
}

TEST(ThrownTreesWithSlidersGainNoEnergyWhileTheSlidersAreShort) {
  // For 1 s. Sliders without limits later run out to tens of meters; such a robot, spinning at 10
  // rad/s with 20 ms steps, can gain energy that its inner motion cannot pay.
  for (const double rate : {3.0, 10.0, 20.0})
    for (unsigned seed = 0; seed < 60; ++seed) {
      const ModelPtr m = tree(seed, {.joints = 6 + static_cast<int>(seed % 5),
                                     .prismatic = true,
                                     .shapes = true,
                                     .chain = seed % 2 == 0});
      const Throw t = throw_tree(m, seed, rate, 20e-3, 1);
      CHECK(t.finite);
      CHECK_NEAR(t.growth, 0, 1e-3);
    }
}

TEST(ContactTakesEnergyAtEveryLanding) {
  // Small steps: no rise beyond rounding, and the fall ends with less than it began with.
  for (unsigned seed = 0; seed < 10; ++seed) {
    const ModelPtr m = thrown_tree(seed);
    const Throw t = throw_tree(m, seed, 2, 1e-3, 1);
    CHECK_NEAR(t.growth, 0, 1e-5);
  }
}

TEST(ABouncingBallNeverRisesAboveItsStart) {
  for (const double e : {0.5, 1.0})
    for (const double dt : {1e-3, 20e-3}) {
      TwinWorld world(options(dt));
      world.add_ground();
      world.set_material_pair("default", "default", {0.5, e, 0});
      Robot& robot = world.add_robot(sphere(0.1, 1));
      robot.set_state(base_at(robot.model(), {0, 0, 1}), std::vector<double>(6, 0.0));
      const double start = robot.mechanical_energy();
      double most = start;
      for (int k = 0; k < 5 / dt; ++k) {
        world.step();
        most = std::fmax(most, robot.mechanical_energy());
      }
      CHECK_NEAR(most, start, 1e-9 * start);
    }
}

// ---- overlap

TEST(AnOverlappingBallIsLiftedInOneStepAndGetsNoSpeedWorthTheName) {
  // At most what closes 0.1 um in a step (docs/design/007-contact-points-on-the-plane.md).
  for (const double depth : {1e-6, 1e-3, 3e-2}) {
    TwinWorld world(options(1e-3));
    world.add_ground();
    Robot& robot = world.add_robot(sphere(0.1, 2));
    robot.set_state(base_at(robot.model(), {0, 0, 0.1 - depth}), std::vector<double>(6, 0.0));
    world.step();
    CHECK_NEAR(robot.q()[2], 0.1, 2e-9);
    CHECK_NEAR(largest(robot.u()), 0, 1.000001e-7 / 1e-3);
    world.step(100);
    CHECK_NEAR(largest(robot.u()), 0, 1e-9);
  }
}

TEST(OverlapOfAJointedRobotGoesBelowATenthOfAMicrometer) {
  // Placed 2 cm deep; links share the lift. One pass per step is linear, so a few steps are needed.
  for (unsigned seed = 0; seed < 20; ++seed) {
    const ModelPtr m = thrown_tree(seed);
    TwinWorld world(options(1e-3));
    world.add_ground();
    Robot& robot = world.add_robot(m);
    State s = random_state(*m, seed, 0, 2.0);
    robot.set_state(s.q, s.u);
    // Lowest point: sink from high above until the first contact shows its gap.
    double lowest = HUGE_VAL;
    while (lowest == HUGE_VAL) {
      s.q[2] -= 0.05;
      robot.set_state(s.q, s.u);
      world.step();
      for (const Contact& c : robot.contacts()) lowest = std::fmin(lowest, c.gap);
    }
    s.q[2] -= lowest + 0.02;
    robot.set_state(s.q, s.u);
    world.step(20);
    double deepest = 0;
    for (const Contact& c : robot.contacts()) deepest = std::fmax(deepest, -c.gap);
    CHECK_NEAR(deepest, 0, 2e-7);
    CHECK(robot.contacts().size() > 0);
  }
}

TEST(LiftingAFallingRobotOutOfTheGroundCostsItsOwnMotion) {
  // Deep in the ground and with joints turning: energy may not grow by more than the motion pays.
  for (unsigned seed = 0; seed < 20; ++seed) {
    const ModelPtr m = thrown_tree(seed);
    TwinWorld world(options(1e-3));
    world.add_ground();
    Robot& robot = world.add_robot(m);
    const State s = random_state(*m, seed, 5, 0.0);
    robot.set_state(s.q, s.u);
    world.step(300);
    double least = robot.mechanical_energy(), growth = 0;
    for (int k = 0; k < 500; ++k) {
      world.step();
      growth = std::fmax(growth, robot.mechanical_energy() - least);
      least = std::fmin(least, robot.mechanical_energy());
    }
    CHECK_NEAR(growth, 0, 1e-5);
  }
}

// ---- substeps

TEST(AStepIsCutOnlyWhereLinksTurnFar) {
  const auto substeps = [](const ModelPtr& m, int row, double rate, int most) {
    WorldOptions o = options(5e-3, Integrator::kEnergySafe, {0, 0, 0});
    o.max_substeps = most;
    TwinWorld world(o);
    Robot& robot = world.add_robot(m);
    State s = random_state(*m, 1, 0);
    s.u[row] = rate;
    robot.set_state(s.q, s.u);
    world.step();
    CHECK_NEAR(robot.time(), 5e-3, 1e-18);
    return robot.info().substeps;
  };
  const ModelPtr ball = sphere(0.1, 1);
  CHECK(substeps(ball, 3, 49, 8) == 1);   // 0.245 rad
  CHECK(substeps(ball, 3, 51, 8) == 2);   // halves at least
  CHECK(substeps(ball, 4, 190, 8) == 4);  // 0.95 rad
  CHECK(substeps(ball, 5, 1e4, 8) == 8);
  CHECK(substeps(ball, 5, 1e4, 3) == 3);
  CHECK(substeps(ball, 5, 1e4, 1) == 1);
  CHECK(substeps(ball, 0, 1e4, 8) == 1);  // translation does not count
  const ModelPtr slider = tree(9, {.joints = 1, .prismatic = true});
  const ModelPtr arm = one_joint(LinkJointType::kRevolute, 1, 0.1, 0.01);
  const ModelPtr rail = one_joint(LinkJointType::kPrismatic, 1, 0.1, 0.01);
  CHECK(substeps(arm, 0, 49, 8) == 1);
  CHECK(substeps(arm, 0, 190, 8) == 4);
  CHECK(substeps(rail, 0, 190, 8) == 1);
}

TEST(SubstepsDoNotChangeAMotionThatNeedsNone) {
  // A ball that spins about its own axis: substeps cut the step, the parabola stays.
  TwinWorld world(options(10e-3));
  Robot& robot = world.add_robot(sphere(0.1, 1));
  robot.set_state(base_at(robot.model(), {0, 0, 0}), std::vector<double>{1, 0, 5, 0, 0, 90});
  for (int k = 1; k <= 50; ++k) {
    world.step();
    CHECK(robot.info().substeps == 4);
    const double t = 10e-3 * k;
    CHECK_NEAR(robot.q()[2], 5 * t - 0.5 * kGravity * t * t, 1e-12);
    CHECK_NEAR(robot.u()[5], 90, 1e-11);
    CHECK_NEAR(world.time(), t, 1e-12);
    // The turn about z adds up exactly too.
    const double half = 0.5 * 90 * t;
    CHECK_NEAR(std::fabs(robot.q()[3] * std::cos(half) + robot.q()[6] * std::sin(half)), 1, 1e-12);
  }
}

// ---- forces

TEST(GeneralizedForcesActAsInverseMassTimesForceOverTheStep) {
  // Both integrators from rest, base rows included: du = dt M^-1 tau, up to velocity products of
  // second order in the tiny change.
  const double dt = 1e-3;
  for (const Integrator integrator : kBoth)
    for (const BaseType base : {BaseType::kFloating, BaseType::kFixed}) {
      const ModelPtr m = tree(21, {.joints = 7, .base = base});
      TwinWorld world(options(dt, integrator, {0, 0, 0}));
      Robot& robot = world.add_robot(m);
      State s = random_state(*m, 2, 0);
      robot.set_state(s.q, s.u);
      Random random(3);
      std::vector<double> tau(m->nu()), a(m->nu());
      for (double& x : tau) x = 1e-5 * random.normal();
      robot.forward_dynamics(tau, a);
      // The mass matrix says the same.
      std::vector<double> mass(m->nu() * m->nu());
      robot.mass_matrix(mass);
      for (int r = 0; r < m->nu(); ++r) {
        double sum = 0;
        for (int k = 0; k < m->nu(); ++k) sum += mass[r * m->nu() + k] * a[k];
        CHECK_NEAR(sum, tau[r], 1e-12 * 1e-5);
      }
      robot.set_generalized_force(tau);
      world.step();
      for (int k = 0; k < m->nu(); ++k) CHECK_NEAR(robot.u()[k], dt * a[k], 1e-9 * dt * largest(a));
    }
}

TEST(BaseForcesGiveExactlyTheirMomentumAndJointForcesNone) {
  const double dt = 5e-3;
  const ModelPtr m = tree(22, {.joints = 7});
  TwinWorld world(options(dt, Integrator::kEnergySafe, {0, 0, 0}));
  Robot& robot = world.add_robot(m);
  const State s = random_state(*m, 4, 2);
  robot.set_state(s.q, s.u);
  Random random(5);
  std::vector<double> tau(m->nu());
  for (double& x : tau) x = random.normal();
  robot.set_generalized_force(tau);
  Vector3 p = robot.linear_momentum(), l = robot.angular_momentum();
  for (int k = 0; k < 100; ++k) {
    // A force at the base origin turns about the center of mass as it lies at the start of the
    // step.
    const Vector3 c = robot.center_of_mass(), b{robot.q()[0], robot.q()[1], robot.q()[2]},
                  r = b - c, f{tau[0], tau[1], tau[2]};
    const Vector3 moment{tau[3] + r[1] * f[2] - r[2] * f[1], tau[4] + r[2] * f[0] - r[0] * f[2],
                         tau[5] + r[0] * f[1] - r[1] * f[0]};
    for (int i = 0; i < 3; ++i) p[i] += dt * f[i], l[i] += dt * moment[i];
    world.step();
    CHECK(robot.info().substeps == 1);
    CHECK_NEAR(norm(robot.linear_momentum() - p), 0, 1e-11);
    CHECK_NEAR(norm(robot.angular_momentum() - l), 0, 1e-11);
  }
}

TEST(AHoveringBodyStaysWhereItIsAndThenFallsFreely) {
  for (const Integrator integrator : kBoth)
    for (const double h : {1e-3, 20e-3}) {
      TwinWorld world(options(h, integrator));
      Robot& robot = world.add_robot(sphere(0.1, 2));
      std::vector<double> tau(6, 0.0);
      tau[2] = 2 * kGravity;
      robot.set_generalized_force(tau);
      world.step(50);
      CHECK_NEAR(robot.q()[2], 0, 1e-13);
      CHECK_NEAR(robot.u()[2], 0, 1e-13);
      CHECK_NEAR(robot.mechanical_energy(), 0, 1e-12);
      robot.set_generalized_force(std::vector<double>(6, 0.0));
      world.step(10);
      CHECK_NEAR(robot.u()[2], -kGravity * 10 * h, 1e-12);
    }
}

TEST(AnArmHeldByPdControlRestsWithoutSpeed) {
  for (const Integrator integrator : kBoth) {
    TwinWorld world(options(5e-3, integrator));
    Robot& robot = world.add_robot(one_joint(LinkJointType::kRevolute, 1, 0.3, 0.01));
    robot.set_pd_gains(std::vector<double>{100}, std::vector<double>{5});
    robot.set_pd_target(std::vector<double>{1.5});
    world.step(2000);
    const double q = robot.q()[0];
    CHECK_NEAR(robot.u()[0], 0, 1e-12);
    CHECK_NEAR(100 * (1.5 - q), kGravity * 0.3 * std::sin(q), 1e-11);
  }
}

TEST(AForceThatHoldsTheWeightHoldsTheRobot) {
  for (const Integrator integrator : kBoth) {
    TwinWorld world(options(1e-3, integrator));
    const ModelPtr m = tree(23, {.joints = 5, .base = BaseType::kFixed});
    Robot& robot = world.add_robot(m);
    const State s = random_state(*m, 6, 0);
    robot.set_state(s.q, s.u);
    std::vector<double> hold(m->nu());
    robot.bias_force(hold);
    robot.set_generalized_force(hold);
    world.step(100);
    CHECK_NEAR(largest(robot.u()), 0, 1e-9);
    CHECK_NEAR(largest_difference(robot.q(), s.q), 0, 1e-10);
  }
}

TEST(JointDampingOfTheModelDecaysAsTheImplicitScheme) {
  const double inertia = 0.3, damping = 0.7, h = 10e-3;
  for (const Integrator integrator : kBoth)
    for (const LinkJointType type : {LinkJointType::kRevolute, LinkJointType::kPrismatic}) {
      TwinWorld world(options(h, integrator, {0, 0, 0}));
      Robot& robot = world.add_robot(one_joint(type, inertia, 0, inertia, damping));
      robot.set_state(std::vector<double>{0}, std::vector<double>{2});
      double u = 2, q = 0;
      for (int k = 0; k < 200; ++k) {
        u *= inertia / (inertia + h * damping), q += h * u;
        world.step();
        CHECK_NEAR(robot.u()[0], u, 1e-13);
        CHECK_NEAR(robot.q()[0], q, 1e-13);
      }
    }
}

TEST(PdControlFollowsItsImplicitRecurrence) {
  const double inertia = 0.3, h = 5e-3, target = 0.8;
  const double gains[][2] = {{40, 1}, {200, 5}, {1e5, 10}, {1e9, 0}, {0, 1e9}};
  for (const Integrator integrator : kBoth)
    for (const auto& [kp, kd] : gains) {
      TwinWorld world(options(h, integrator, {0, 0, 0}));
      Robot& robot = world.add_robot(one_joint(LinkJointType::kPrismatic, inertia, 0, 0.1));
      robot.set_pd_gains(std::vector<double>{kp}, std::vector<double>{kd});
      robot.set_pd_target(std::vector<double>{target});
      robot.set_state(std::vector<double>{0}, std::vector<double>{0.5});
      double u = 0.5, q = 0;
      for (int k = 0; k < 300; ++k) {
        u += h * (kp * (target - q - h * u) - kd * u) / (inertia + h * kd + h * h * kp), q += h * u;
        world.step();
        CHECK_NEAR(robot.u()[0], u, 1e-9);
        CHECK_NEAR(robot.q()[0], q, 1e-9);
      }
      if (kd < 1e8) CHECK_NEAR(q, target, 0.05);
    }
}

TEST(VeryStiffGainsHoldARobotOnTheGroundAt20Milliseconds) {
  for (const Integrator integrator : kBoth)
    for (const double kp : {1e3, 1e6, 1e9}) {
      const ModelPtr m = tree(24, {.joints = 8, .prismatic = false, .shapes = true});
      TwinWorld world(options(20e-3, integrator));
      world.add_ground();
      Robot& robot = world.add_robot(m);
      const State s = random_state(*m, 7, 0, 0.8);
      robot.set_state(s.q, s.u);
      const std::vector<double> target(s.q.begin() + 7, s.q.end());
      robot.set_pd_gains(std::vector<double>(8, kp), std::vector<double>(8, 0.01 * kp));
      robot.set_pd_target(target);
      double fastest = 0;
      for (int k = 0; k < 250; ++k) {
        world.step();
        fastest = std::fmax(fastest, largest(robot.u()));
      }
      CHECK(robot.info().status != StepStatus::kNonFinite);
      CHECK(fastest < 60);
      CHECK(largest_difference(robot.q().subspan(7), target) < 2e2 / kp);
      CHECK(joint_rates(robot) < 0.1);
    }
}

TEST(QuestionsBetweenStepsDoNotChangeTheMotion) {
  const ModelPtr m = thrown_tree(3);
  for (const Integrator integrator : kBoth) {
    std::vector<double> q[2];
    for (int asks = 0; asks < 2; ++asks) {
      TwinWorld world(options(5e-3, integrator));
      world.add_ground();
      Robot& robot = world.add_robot(m);
      const State s = random_state(*m, 8, 2, 0.5);
      robot.set_state(s.q, s.u);
      std::vector<double> matrix(m->nu() * m->nu()), row(m->nu()), jacobian(6 * m->nu());
      for (int k = 0; k < 200; ++k) {
        world.step();
        if (!asks) continue;
        robot.mass_matrix(matrix);
        robot.bias_force(row);
        robot.forward_dynamics(row, row);
        robot.jacobian("link100", jacobian);
        robot.frame_pose("link0");
        robot.mechanical_energy(), robot.angular_momentum(), robot.contacts();
        world.next_contact_problem(0);
        world.last_contact_problem(0);
      }
      q[asks] = copy(robot.q());
    }
    CHECK(same_bits(q[0], q[1]));
  }
}

TEST(AllOfThisHeldForBatchesToo) { CHECK(TwinWorld::compared() > 1000); }
