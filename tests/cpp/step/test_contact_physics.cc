// Contact against closed forms, computed with the step's own discretization: what is left is
// rounding. Inclines are a level ground under tilted gravity.
//
// Both integrators push with m g h per step; the energy-safe one only with m g h / 2 in the first,
// because its velocities belong to the middle of gravity's kick while in contact. So after n steps
// under an acceleration a it has v = (n - 1/2) h a and has gone a (n h)^2 / 2; the paper's has
// v = n h a and a h^2 n (n + 1) / 2.
#include <algorithm>

#include "check.h"
#include "step/twin_world.h"

using namespace bodies;

namespace {

constexpr double kStep = 1e-3;  // [s]

/// Half a step late in velocity: see above.
double late(Integrator integrator) { return integrator == Integrator::kEnergySafe ? 0.5 : 0; }

/// Gap of a start in contact [m]. The paper's step takes overlaps only; the energy-safe one would
/// answer an overlap with a push of (overlap / h).
double touch(Integrator integrator) { return integrator == Integrator::kEnergySafe ? 0 : -1e-12; }

struct Scene {
  TwinWorld world;
  Robot& robot;
  Scene(const ModelPtr& model, const WorldOptions& o, double friction, double restitution = 0,
        double ground = 0)
      : world(o), robot(world.add_robot(model)) {
    world.add_ground(ground);
    world.set_material_pair("default", "default", {friction, restitution, 0});
  }
  void place(const Vector3& position, const std::vector<double>& u,
             const std::array<double, 4>& quaternion = {1, 0, 0, 0}) {
    robot.set_state(base_at(robot.model(), position, quaternion), u);
  }
};

Vector3 tilted(double angle, double azimuth = 0) {
  const double side = kGravity * std::sin(angle);
  return {side * std::cos(azimuth), side * std::sin(azimuth), -kGravity * std::cos(angle)};
}

std::array<double, 4> about(const Vector3& axis, double angle) {
  const double s = std::sin(angle / 2);
  return {std::cos(angle / 2), s * axis[0], s * axis[1], s * axis[2]};
}

Vector3 total_impulse(const Robot& robot) {
  Vector3 sum{0, 0, 0};
  for (const Contact& c : robot.contacts())
    for (int k = 0; k < 3; ++k) sum[k] += c.impulse[k];
  return sum;
}

double smallest_gap(const Robot& robot) {
  double gap = HUGE_VAL;
  for (const Contact& c : robot.contacts()) gap = std::fmin(gap, c.gap);
  return gap;
}

const Vector3 kBrick{0.4, 0.3, 0.2};

}  // namespace

// ---- a block on an incline

TEST(ABlockSticksBelowTheFrictionAngleWithoutCreep) {
  // At the solver's default tolerances, 10 s each. The first steps after the touch creep with what
  // the solver leaves (1e-9 m/s per sweep).
  const double mu = 0.5;
  for (const Integrator integrator : kBoth)
    for (const double azimuth : {0.0, 0.7, 2.4}) {
      Scene s(box(kBrick, 3), options(kStep, integrator, tilted(std::atan(mu) - 1e-3, azimuth)),
              mu);
      s.place({0, 0, 0.1 + touch(integrator)}, std::vector<double>(6, 0.0));
      s.world.step(50);
      const std::vector<double> q = copy(s.robot.q());
      double creep = 0;
      for (int k = 0; k < 10000; ++k) {
        s.world.step();
        creep = std::fmax(creep, largest(s.robot.u().first(3)));
      }
      CHECK_NEAR(creep, 0, 1e-9);
      CHECK_NEAR(largest_difference(s.robot.q(), q), 0, 1e-9);
    }
}

TEST(ABlockSlidesAboveTheFrictionAngleWithTheExactAcceleration) {
  const double mu = 0.3;
  for (const Integrator integrator : kBoth)
    for (const double azimuth : {0.0, 1.0, 4.0}) {
      const double angle = std::atan(mu) + 0.1;
      Scene s(box(kBrick, 3), exact(options(kStep, integrator, tilted(angle, azimuth))), mu);
      s.place({0, 0, 0.1 + touch(integrator)}, std::vector<double>(6, 0.0));
      const double a = kGravity * (std::sin(angle) - mu * std::cos(angle));
      for (int n = 1; n <= 500; ++n) {
        s.world.step();
        const double v = (n - late(integrator)) * kStep * a;
        CHECK_NEAR(s.robot.u()[0], v * std::cos(azimuth), 1e-11);
        CHECK_NEAR(s.robot.u()[1], v * std::sin(azimuth), 1e-11);
        CHECK_NEAR(largest(s.robot.u().subspan(2)), 0, 1e-11);
      }
      const double way = 0.5 * a * kStep * kStep *
                         (integrator == Integrator::kEnergySafe ? 500.0 * 500 : 500.0 * 501);
      CHECK_NEAR(std::hypot(s.robot.q()[0], s.robot.q()[1]), way, 1e-11);
    }
}

TEST(TheFrictionAngleIsAtanMuToAMillionth) {
  const double mu = 0.7;
  for (const Integrator integrator : kBoth)
    for (const double off : {-1e-6, 1e-6}) {
      Scene s(box(kBrick, 3), options(kStep, integrator, tilted(std::atan(mu) + off)), mu);
      s.place({0, 0, 0.1 + touch(integrator)}, std::vector<double>(6, 0.0));
      s.world.step(1000);  // above: 1 s at 1.2e-5 m/s^2
      CHECK((s.robot.u()[0] > 5e-6) == (off > 0));
      CHECK(off > 0 || std::fabs(s.robot.u()[0]) < 1e-9);
    }
}

TEST(AThrownBlockStopsWhereItMustInEveryDirection) {
  const double mu = 0.4, v0 = 0.9, loss = mu * kGravity * kStep;
  for (const Integrator integrator : kBoth) {
    const int slides = static_cast<int>(std::ceil(v0 / loss + late(integrator))) - 1;
    double way = 0;
    for (int n = 1; n <= slides; ++n) way += kStep * (v0 - loss * (n - late(integrator)));
    for (int k = 0; k < 12; ++k) {
      // The block is turned too: neither its edges nor the contact frame may show.
      const double direction = k * M_PI / 6 + 0.05, x = std::cos(direction),
                   y = std::sin(direction);
      Scene s(box(kBrick, 3), exact(options(kStep, integrator)), mu);
      s.place({0, 0, 0.1 + touch(integrator)}, {v0 * x, v0 * y, 0, 0, 0, 0},
              about({0, 0, 1}, 0.3 * k));
      int steps = 0;
      while (norm({s.robot.u()[0], s.robot.u()[1], 0}) > 1e-9 && steps < 1000) {
        s.world.step();
        ++steps;
      }
      CHECK(steps == slides + 1);
      const double along = s.robot.q()[0] * x + s.robot.q()[1] * y,
                   across = s.robot.q()[1] * x - s.robot.q()[0] * y;
      CHECK_NEAR(along, way, 1e-11);
      CHECK_NEAR(across / along, 0, 1e-10);
      CHECK_NEAR(way, v0 * v0 / (2 * mu * kGravity), 1.1 * kStep * v0);
      s.world.step(100);
      CHECK_NEAR(s.robot.q()[0] * x + s.robot.q()[1] * y, way, 1e-10);
    }
  }
}

TEST(FrictionIsAsStrongInEveryDirection) {
  // One sphere without turning: |impulse| = mu m g h against the velocity, for 360 directions.
  const double mu = 0.6, mass = 2;
  double least = HUGE_VAL, most = 0, turn = 0;
  for (int k = 0; k < 360; ++k) {
    const double direction = k * M_PI / 180, x = std::cos(direction), y = std::sin(direction);
    Scene s(sphere(0.1, mass, 1e6), exact(options(kStep, Integrator::kSemiImplicit)), mu);
    s.place({0, 0, 0.1 + touch(Integrator::kSemiImplicit)}, {x, y, 0, 0, 0, 0});
    s.world.step();
    const Vector3 p = total_impulse(s.robot);
    const double friction = std::hypot(p[0], p[1]);
    least = std::fmin(least, friction), most = std::fmax(most, friction);
    turn = std::fmax(turn, std::fabs(p[0] * y - p[1] * x) / friction);
  }
  CHECK_NEAR(most, mu * mass * kGravity * kStep, 1e-13);
  CHECK_NEAR(most - least, 0, 1e-13);
  CHECK_NEAR(turn, 0, 1e-11);
}

TEST(WithoutFrictionNothingStopsABlock) {
  for (const Integrator integrator : kBoth) {
    Scene s(box(kBrick, 3), options(kStep, integrator), 0);
    s.place({0, 0, 0.1 + touch(integrator)}, {0.5, -0.25, 0, 0, 0, 0});
    s.world.step(1000);
    CHECK_NEAR(s.robot.u()[0], 0.5, 1e-12);
    CHECK_NEAR(s.robot.u()[1], -0.25, 1e-12);
    CHECK_NEAR(s.robot.q()[0], 0.5, 1e-10);
    const Vector3 p = total_impulse(s.robot);
    CHECK_NEAR(p[0], 0, 1e-15);
    CHECK_NEAR(p[1], 0, 1e-15);
  }
}

// ---- rest

TEST(ABoxAtRestCarriesItsWeightAndStaysForTenSeconds) {
  const double mass = 7;
  for (const Integrator integrator : kBoth)
    for (const double ground : {0.0, -1.3, 2.75}) {
      Scene s(box(kBrick, mass), options(kStep, integrator), 0.8, 0, ground);
      s.place({0.1, 0.2, ground + 0.1 + touch(integrator)}, std::vector<double>(6, 0.0),
              about({0, 0, 1}, 0.4));
      s.world.step(2);
      const std::vector<double> q = copy(s.robot.q());
      double weight = 0;
      for (int k = 0; k < 10000; ++k) {
        s.world.step();
        const Vector3 p = total_impulse(s.robot);
        weight = std::fmax(weight, std::fabs(p[2] - mass * kGravity * kStep));
        weight = std::fmax(weight, std::hypot(p[0], p[1]));
      }
      CHECK_NEAR(weight, 0, 1e-8 * mass * kGravity * kStep);
      CHECK_NEAR(largest_difference(s.robot.q(), q), 0, 1e-10);
      CHECK_NEAR(largest(s.robot.u()), 0, 1e-10);
      CHECK(s.robot.contacts().size() == 4);
    }
}

TEST(EveryShapeRestsOnItsLowestPoints) {
  struct Case {
    ModelPtr model;
    double height;  // of the center at rest
    std::array<double, 4> quaternion;
    size_t touching;
  };
  const double half_turn = M_PI / 2;
  const Case cases[] = {
      {sphere(0.1, 2), 0.1, {1, 0, 0, 0}, 1},
      {box(kBrick, 2), 0.2, about({0, 1, 0}, half_turn), 4},
      {cylinder(0.1, 0.3, 2), 0.15, {1, 0, 0, 0}, 4},
      {cylinder(0.1, 0.3, 2), 0.15, about({1, 0, 0}, 2 * half_turn), 4},
      {cylinder(0.1, 0.3, 2), 0.1, about({1, 0, 0}, half_turn), 2},
      {cylinder(0.1, 0.3, 2, ShapeType::kCapsule), 0.1, about({1, 0, 0}, half_turn), 2},
  };
  for (const Case& c : cases) {
    // Dropped from 3 cm, the default integrator ends on the surface.
    Scene s(c.model, options(kStep), 0.8);
    s.place({0, 0, c.height + 0.03}, std::vector<double>(6, 0.0), c.quaternion);
    s.world.step(1000);
    CHECK_NEAR(s.robot.q()[2], c.height, 2e-9);
    CHECK_NEAR(largest(s.robot.u()), 0, 1e-9);
    CHECK_NEAR(total_impulse(s.robot)[2], 2 * kGravity * kStep, 1e-9);
    size_t touching = 0;
    for (const Contact& k : s.robot.contacts()) touching += k.impulse[2] > 1e-6;
    CHECK(touching >= 1 && touching <= c.touching);
  }
}

TEST(GroundHeightMovesTheSceneAndNothingElse) {
  for (const Integrator integrator : kBoth) {
    std::vector<double> u[2], q[2];
    for (int k = 0; k < 2; ++k) {
      const double ground = k * 0.5;
      Scene s(box(kBrick, 3), options(kStep, integrator), 0.6, 0, ground);
      s.place({0, 0, ground + 0.3}, {0.5, 0.2, 0, 1, 2, 0.5});
      s.world.step(300);
      q[k] = copy(s.robot.q()), u[k] = copy(s.robot.u());
      q[k][2] -= ground;
    }
    CHECK_NEAR(largest_difference(q[0], q[1]), 0, 1e-8);
    CHECK_NEAR(largest_difference(u[0], u[1]), 0, 1e-7);
  }
}

// ---- rolling

namespace {

/// Slides with v0 along x and turns about y: ends rolling with v0 / (1 + k) for an inertia k m r^2.
void check_slip_to_roll(const ModelPtr& model, double k, double radius,
                        const std::array<double, 4>& quaternion) {
  const double mu = 0.3, v0 = 1.2, g = kGravity;
  for (const Integrator integrator : kBoth) {
    Scene s(model, exact(options(kStep, integrator)), mu);
    s.place({0, 0, radius + touch(integrator)}, {v0, 0, 0, 0, 0, 0}, quaternion);
    // The contact point loses mu g (1 + 1/k) h per step.
    const double loss = mu * g * (1 + 1 / k) * kStep;
    const int slides = static_cast<int>(std::ceil(v0 / loss + late(integrator))) - 1;
    for (int n = 1; n <= slides; ++n) {
      s.world.step();
      const double t = (n - late(integrator)) * kStep;
      CHECK_NEAR(s.robot.u()[0], v0 - mu * g * t, 1e-10);
      CHECK_NEAR(s.robot.u()[4], mu * g * t / (k * radius), 1e-9);
    }
    s.world.step(300);
    CHECK_NEAR(s.robot.u()[0], v0 / (1 + k), 1e-9);
    CHECK_NEAR(s.robot.u()[0] - radius * s.robot.u()[4], 0, 1e-10);
    CHECK_NEAR(s.robot.u()[1], 0, 1e-9);
    CHECK_NEAR(slides * kStep, v0 / (mu * g * (1 + 1 / k)), 2 * kStep);
    CHECK(smallest_gap(s.robot) > -1e-7);
  }
}

}  // namespace

TEST(ASlidingSphereEndsRollingWithFiveSeventhsOfItsSpeed) {
  check_slip_to_roll(sphere(0.1, 2), 0.4, 0.1, {1, 0, 0, 0});
  check_slip_to_roll(sphere(0.1, 2, 2.0 / 3), 2.0 / 3, 0.1, {1, 0, 0, 0});
}

TEST(ACylinderAndACapsuleRollWithTwoThirdsOfTheirSpeed) {
  // The axis is turned from z to y.
  for (const ShapeType type : {ShapeType::kCylinder, ShapeType::kCapsule})
    check_slip_to_roll(cylinder(0.1, 0.3, 2, type), 0.5, 0.1, about({1, 0, 0}, M_PI / 2));
}

TEST(ASphereRollsDownAnInclineWithFiveSeventhsOfGravity) {
  for (const Integrator integrator : kBoth) {
    const double angle = 0.3;
    Scene s(sphere(0.1, 2), exact(options(kStep, integrator, tilted(angle))), 0.5);
    s.place({0, 0, 0.1 + touch(integrator)}, std::vector<double>(6, 0.0));
    for (int n = 1; n <= 500; ++n) {
      s.world.step();
      const double v = 5.0 / 7 * kGravity * std::sin(angle) * (n - late(integrator)) * kStep;
      CHECK_NEAR(s.robot.u()[0], v, 1e-10);
      CHECK_NEAR(s.robot.u()[4], v / 0.1, 1e-9);
    }
  }
}

TEST(ASphereOnASteepInclineSlipsIffTheTangentExceedsSevenHalvesOfMu) {
  const double mu = 0.2;
  for (const Integrator integrator : kBoth)
    for (const double off : {-1e-3, 1e-3}) {
      const double angle = std::atan(3.5 * mu) + off;
      Scene s(sphere(0.1, 2), options(kStep, integrator, tilted(angle)), mu);
      s.place({0, 0, 0.1 + touch(integrator)}, std::vector<double>(6, 0.0));
      s.world.step(500);
      const double slip = s.robot.u()[0] - 0.1 * s.robot.u()[4];
      const double expected = off < 0 ? 0
                                      : kGravity * (std::sin(angle) - 3.5 * mu * std::cos(angle)) *
                                            (500 - late(integrator)) * kStep;
      CHECK_NEAR(slip, expected, 1e-6);
    }
}

// ---- impact

TEST(TheDelassusBlockOfARodEndIsTheClosedForm) {
  // [1 + 3 sin^2, -+3 sin cos, 1 + 3 cos^2] / m at the angle of the rod to the ground.
  const double mass = 1.7, length = 0.8, angle = 0.6, r = 1e-9;
  const double c = std::cos(angle), s = std::sin(angle);
  for (const Integrator integrator : kBoth) {
    Scene scene(rod(length, mass, r), options(kStep, integrator), 0.5);
    // A turn about -y lifts the far end.
    scene.place({0, 0, length / 2 * s + r - 1e-10}, {0, 0, -2, 0, 0, 0}, about({0, -1, 0}, angle));
    const ContactProblem p = scene.world.next_contact_problem(0);
    CHECK(p.num_contacts() == 1);
    CHECK_NEAR(p.delassus[0], (1 + 3 * s * s) / mass, 1e-7);
    CHECK_NEAR(p.delassus[8], (1 + 3 * c * c) / mass, 1e-7);
    CHECK_NEAR(p.delassus[2], -3 * s * c / mass, 1e-7);
    CHECK(p.delassus[2] == p.delassus[6]);
    const Vector3 tip{-length / 2 * c, 0, scene.robot.q()[2] - length / 2 * s};
    std::vector<double> g(9);
    scene.robot.delassus(std::vector<int>{0}, std::vector<Vector3>{tip}, g);
    CHECK_NEAR(g[0], (1 + 3 * s * s) / mass, 1e-13);
    CHECK_NEAR(g[8], (1 + 3 * c * c) / mass, 1e-13);
    CHECK_NEAR(std::fabs(g[2]), 3 * s * c / mass, 1e-13);
  }
}

TEST(AFallingRodIsStoppedByTheImpulseOfItsEffectiveMass) {
  const double mass = 1.7, length = 0.8, speed = 2, r = 1e-9;
  for (const Integrator integrator : kBoth)
    for (const double angle : {0.2, 0.6, 1.1, 1.5}) {
      const double c = std::cos(angle), s = std::sin(angle);
      const double nn = (1 + 3 * c * c) / mass, tt = (1 + 3 * s * s) / mass, nt = -3 * s * c / mass;
      for (const double mu : {0.0, 0.1, 10.0}) {
        Scene scene(rod(length, mass, r), exact(options(kStep, integrator, {0, 0, 0})), mu);
        scene.place({0, 0, length / 2 * s + r + touch(integrator)}, {0, 0, -speed, 0, 0, 0},
                    about({0, -1, 0}, angle));
        scene.world.step();
        // Sticking if the impulse that stops both directions lies in the cone; else it slides at
        // the edge, towards -nt.
        double n = speed / (nn - nt * nt / tt), t = -nt * n / tt;
        if (std::fabs(t) > mu * n) {
          const double sign = t > 0 ? 1 : -1;
          n = speed / (nn + sign * mu * nt), t = sign * mu * n;
        }
        const Vector3 p = total_impulse(scene.robot);
        CHECK_NEAR(p[2], n, 1e-6 * n);
        CHECK_NEAR(p[0], t, 1e-6 * n);
        CHECK_NEAR(p[1], 0, 1e-12);
        const Vector3 v = scene.robot.contacts()[0].velocity;
        CHECK_NEAR(v[2], 0, 1e-12);
        CHECK_NEAR(v[0], nt * n + tt * t, 1e-6);
      }
    }
}

TEST(ABallBouncesWithTheRestitutionOfItsMaterials) {
  for (const Integrator integrator : kBoth)
    for (const double e : {0.0, 0.3, 0.8, 1.0}) {
      // No gravity: the rebound is e times the approach, in the step in which the gap closes.
      Scene s(sphere(0.1, 2), exact(options(kStep, integrator, {0, 0, 0})), 0.5, e);
      s.place({0, 0, 0.105}, {0, 0, -2, 0, 0, 0});
      s.world.step(10);
      CHECK_NEAR(s.robot.u()[2], 2 * e, 1e-12);
      if (e == 0) CHECK(s.robot.q()[2] < 0.1 + 1e-9);
    }
}

TEST(RestitutionStopsBelowItsThreshold) {
  for (const Integrator integrator : kBoth)
    for (const double threshold : {1.9, 2.1}) {
      Scene s(sphere(0.1, 2), options(kStep, integrator, {0, 0, 0}), 0.5);
      s.world.set_material_pair("default", "default", {0.5, 0.5, threshold});
      s.place({0, 0, 0.105}, {0, 0, -2, 0, 0, 0});
      s.world.step(10);
      CHECK_NEAR(s.robot.u()[2], threshold < 2 ? 1.0 : 0.0, 1e-9);
    }
}

TEST(HeightsOfABouncingBallFallWithTheSquareOfRestitution) {
  for (const Integrator integrator : kBoth) {
    const double e = 0.8, h0 = 1;
    Scene s(sphere(0.1, 2), options(1e-4, integrator), 0.5, e);
    s.place({0, 0, 0.1 + h0}, std::vector<double>(6, 0.0));
    double before = 0, height = h0;
    int bounces = 0;
    for (int k = 0; k < 30000 && bounces < 4; ++k) {
      s.world.step();
      if (before > 0 && s.robot.u()[2] <= 0) {
        height *= e * e, ++bounces;
        CHECK_NEAR((s.robot.q()[2] - 0.1) / height, 1, 5e-3);
      }
      before = s.robot.u()[2];
    }
    CHECK(bounces == 4);
  }
}

TEST(AMaterialPairIsTheShapesOrElseTheRobots) {
  ModelBuilder builder("two");
  builder.add_link("body", inertial(2, {0.01, 0.01, 0.01}));
  Shape foot = shape(ShapeType::kSphere, {0.1, 0, 0});
  foot.material = "ice";
  builder.add_shape("body", foot);
  const ModelPtr slippery = builder.build(BaseType::kFloating);
  World world(options(kStep));
  world.add_ground(0, "street");
  world.set_material_pair("street", "ice", {0.05, 0, 0});
  world.set_material_pair("rubber", "street", {1.1, 0, 0});
  RobotOptions o;
  o.position = {0, 0, 0.1};
  o.material = "rubber";
  Robot& a = world.add_robot(slippery, o);
  Robot& b = world.add_robot(sphere(0.1, 2), o);
  o.material = "unheard of";
  Robot& c = world.add_robot(sphere(0.1, 2), o);
  world.step();
  CHECK(a.contacts()[0].friction == 0.05);
  CHECK(b.contacts()[0].friction == 1.1);
  CHECK(c.contacts()[0].friction == 0.8);
}

TEST(RobotsDoNotInfluenceEachOther) {
  const ModelPtr models[] = {box(kBrick, 3), sphere(0.1, 2), tree(4, {.joints = 6, .shapes = true}),
                             tree(5, {.joints = 9, .shapes = true})};
  for (const Integrator integrator : kBoth) {
    const auto place = [](Robot& r, int k) {
      const State s = random_state(r.model(), 70 + k, 2, 0.6);
      r.set_state(s.q, s.u);
    };
    World together(options(2e-3, integrator));
    together.add_ground();
    for (int k = 0; k < 4; ++k) place(together.add_robot(models[k]), k);
    together.step(500);
    for (int k = 0; k < 4; ++k) {
      World alone(options(2e-3, integrator));
      alone.add_ground();
      Robot& r = alone.add_robot(models[k]);
      place(r, k);
      alone.step(500);
      CHECK(same_bits(r.q(), together.robot(k).q()));
      CHECK(same_bits(r.u(), together.robot(k).u()));
    }
  }
}

TEST(EverySolverMethodSlidesABlockAlike) {
  struct Choice {
    SolveMethod method;
    FrictionLaw law;
    SingleContactMethod single;
  };
  const Choice choices[] = {
      {SolveMethod::kAuto, FrictionLaw::kCoulomb, SingleContactMethod::kHalley},
      {SolveMethod::kAuto, FrictionLaw::kMaxDissipation, SingleContactMethod::kHalley},
      {SolveMethod::kPerContact, FrictionLaw::kCoulomb, SingleContactMethod::kHalley},
      {SolveMethod::kPerContact, FrictionLaw::kCoulomb, SingleContactMethod::kBisection},
      {SolveMethod::kPerContact, FrictionLaw::kMaxDissipation, SingleContactMethod::kBisection},
      {SolveMethod::kPerContact, FrictionLaw::kMaxDissipation, SingleContactMethod::kGoldenSection},
      {SolveMethod::kPgs, FrictionLaw::kCoulomb, SingleContactMethod::kHalley},
  };
  // A single contact that does not turn: both laws agree.
  const double mu = 0.3, angle = 0.6, a = kGravity * (std::sin(angle) - mu * std::cos(angle));
  for (const Choice& c : choices)
    for (const Integrator integrator : kBoth) {
      WorldOptions o = options(kStep, integrator, tilted(angle, 0.8));
      o.solver.method = c.method, o.solver.law = c.law, o.solver.single_contact = c.single;
      o.solver.tolerance = 1e-10;
      Scene s(sphere(0.1, 2, 1e6), o, mu);
      s.place({0, 0, 0.1 + touch(integrator)}, std::vector<double>(6, 0.0));
      s.world.step(200);
      const double v = (200 - late(integrator)) * kStep * a;
      CHECK_NEAR(s.robot.u()[0], v * std::cos(0.8), 1e-5);
      CHECK_NEAR(s.robot.u()[1], v * std::sin(0.8), 1e-5);
    }
}

TEST(AllOfThisHeldForBatchesToo) { CHECK(TwinWorld::compared() > 1000); }
