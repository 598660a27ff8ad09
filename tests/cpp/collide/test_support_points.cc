// Heights of shapes against their support points, on random trees.
#include <algorithm>
#include <random>

#include "check.h"
#include "collide/support_points.h"
#include "dynamics/random_robots.h"
#include "layout/ground_shapes.h"
#include "layout/tree_memory.h"

using namespace stickslip;

namespace {

constexpr ShapeType kTypes[] = {ShapeType::kSphere, ShapeType::kBox, ShapeType::kCapsule,
                                ShapeType::kCylinder};

/// A base with three links and every kind of shape on each of the four.
ModelPtr random_shapes(std::mt19937& rng) {
  std::uniform_real_distribution<double> u(-1, 1);
  ModelBuilder builder("shapes");
  builder.add_link("link0", testing::random_inertial(rng));
  for (int k = 1; k < 4; ++k) {
    builder.add_link("link" + std::to_string(k), testing::random_inertial(rng));
    LinkJoint joint;
    joint.name = "joint" + std::to_string(k);
    joint.type = LinkJointType::kRevolute;
    joint.parent = "link" + std::to_string(k - 1);
    joint.child = "link" + std::to_string(k);
    joint.pose.rotation = testing::random_rotation(rng);
    joint.pose.position = {0.3 * u(rng), 0.3 * u(rng), 0.3 * u(rng)};
    joint.axis = {u(rng), u(rng), u(rng)};
    builder.add_joint(joint);
  }
  for (int k = 0; k < 4; ++k)
    for (const ShapeType type : kTypes) {
      Shape shape;
      shape.type = type;
      for (double& s : shape.size) s = 0.2 + 0.15 * u(rng);
      shape.pose.rotation = testing::random_rotation(rng);
      shape.pose.position = {0.2 * u(rng), 0.2 * u(rng), 0.2 * u(rng)};
      builder.add_shape("link" + std::to_string(k), shape);
    }
  return builder.build(BaseType::kFloating);
}

/// Lowest point and lowest support point of each shape of a random robot in a random pose.
template <class S, class F>
void on_random_robots(int robots, const F& f) {
  std::mt19937 rng(7);
  std::normal_distribution<double> normal;
  for (int r = 0; r < robots; ++r) {
    const ModelPtr model = random_shapes(rng);
    layout::TreeMemory<S> memory(*model);
    double w[4], square = 0;
    for (double& x : w) x = normal(rng), square += x * x;
    S quaternion[4], joints[3];
    for (int k = 0; k < 4; ++k) quaternion[k] = constant<S>(w[k] / std::sqrt(square));
    for (S& q : joints) q = constant<S>(normal(rng));
    dynamics::compute_positions(memory.tree(), quaternion, joints);
    const auto shapes = layout::ground_shapes(*model, memory.layout());
    CHECK(shapes.size() == 16);
    for (const collide::GroundShape& shape : shapes) {
      const collide::PlacedShape<S> placed = collide::place(memory.tree(), shape);
      double lowest = HUGE_VAL;
      for (int k = 0; k < shape.num_points; ++k)
        lowest = std::min<double>(lowest, get_lane(collide::support_point(shape, placed, k).z, 0));
      f(shape, double(get_lane(collide::lowest_point(memory.tree(), shape), 0)), lowest);
    }
  }
}

}  // namespace

TEST(NoSupportPointIsBelowTheLowestPointOfItsShape) {
  const auto check = [](double tolerance) {
    return [tolerance](const collide::GroundShape&, double bound, double lowest) {
      CHECK(bound <= lowest + tolerance);
    };
  };
  on_random_robots<double>(50, check(1e-14));
  on_random_robots<float>(50, check(2e-6));
  on_random_robots<Pack<float, 4>>(50, check(2e-6));
}

TEST(TheLowestPointIsThatOfASupportPointButForCylinders) {
  on_random_robots<double>(50, [](const collide::GroundShape& shape, double bound, double lowest) {
    // A cylinder is bounded by the capsule around it, which is at most a radius longer at each end.
    const double slack = shape.type == collide::GroundShapeType::kCylinder ? shape.half[0] : 0;
    CHECK(bound >= lowest - slack - 1e-14);
  });
}
