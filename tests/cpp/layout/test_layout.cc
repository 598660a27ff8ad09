// What kernels read of a model: every joint and body has one place, shapes and their points are
// numbered.
#include <set>
#include <string>
#include <utility>

#include "check.h"
#include "dynamics/random_robots.h"
#include "layout/ground_shapes.h"

using namespace stickslip;
using layout::TreeLayout;

namespace {

Shape shape(ShapeType type, const Vector3& size) {
  Shape s;
  s.type = type;
  s.size = size;
  if (type == ShapeType::kMesh) s.mesh_file = "hand.stl";
  return s;
}

/// Two links, a mesh between shapes of every other kind.
ModelPtr shapes_on_two_links(BaseType base) {
  std::mt19937 rng(1);
  ModelBuilder builder("shapes");
  builder.add_link("thigh", testing::random_inertial(rng));
  builder.add_link("shank", testing::random_inertial(rng));
  LinkJoint joint;
  joint.name = "knee", joint.parent = "thigh", joint.child = "shank";
  joint.type = LinkJointType::kRevolute;
  joint.axis = {0, 1, 0};
  builder.add_joint(joint);
  builder.add_shape("thigh", shape(ShapeType::kBox, {0.2, 0.4, 0.6}));
  builder.add_shape("shank", shape(ShapeType::kSphere, {0.1, 0, 0}));
  builder.add_shape("shank", shape(ShapeType::kMesh, {0, 0, 0}));
  builder.add_shape("shank", shape(ShapeType::kCylinder, {0.1, 0.3, 0}));
  builder.add_shape("shank", shape(ShapeType::kCapsule, {0.1, 0.3, 0}));
  return builder.build(base);
}

double trace(const double inertia[6]) { return inertia[0] + inertia[3] + inertia[5]; }

}  // namespace

TEST(LegsOfOneShapeLieSideBySideWhereThereAreLanesForThem) {
  const ModelPtr robot = testing::aligned_legs(3, true);
  const TreeLayout wide(*robot, 4), narrow(*robot, 1);
  CHECK(wide.bundles.size() == 1 && wide.bundles[0].lanes == 4 && wide.num_slots == 7);
  CHECK(narrow.bundles.size() == 4 && narrow.bundles[0].lanes == 1 && narrow.num_slots == 28);
}

TEST(EveryJointHasOnePlaceAndItsParentComesBefore) {
  for (unsigned seed = 0; seed < 40; ++seed)
    for (const int lanes : {1, 4}) {
      const ModelPtr robot = testing::random_robot(
          seed, 1 + int(seed) % 17, 0, seed % 2 ? BaseType::kFixed : BaseType::kFloating);
      const TreeLayout tree(*robot, lanes);
      std::set<std::pair<int, int>> places;
      bool right = true;
      for (int body = 1; body <= robot->num_joints(); ++body) {
        const dynamics::LinkIndex at = tree.link_of_body[body];
        right = right && places.insert({at.slot, at.lane}).second;
        right = right && tree.slots[at.slot].joint[at.lane] == body - 1;
        const dynamics::LinkIndex parent = tree.slots[at.slot].parent[at.lane],
                                  wanted = tree.link_of_body[robot->joints()[body - 1].parent_body];
        right = right && parent.slot == wanted.slot && parent.slot < at.slot;
        right = right && (parent.slot == dynamics::kBaseSlot || parent.lane == wanted.lane);
      }
      CHECK(right);
    }
}

TEST(LinksWithShapesOrChainsCarrySomething) {
  CHECK(TreeLayout(*shapes_on_two_links(BaseType::kFloating), 1).slots[0].carries);
  std::mt19937 rng(2);
  ModelBuilder builder(
      "fork");  // hip - knee - two toes, the second with a sphere, a mesh on the knee
  for (const char* link : {"base", "hip", "knee", "inner", "outer"})
    builder.add_link(link, testing::random_inertial(rng));
  const char* parents[] = {"base", "hip", "knee", "knee"};
  const char* children[] = {"hip", "knee", "inner", "outer"};
  for (int k = 0; k < 4; ++k) {
    LinkJoint joint;
    joint.name = std::string("to_") + children[k], joint.parent = parents[k];
    joint.child = children[k], joint.type = LinkJointType::kRevolute, joint.axis = {0, 1, 0};
    builder.add_joint(joint);
  }
  builder.add_shape("hip", shape(ShapeType::kMesh, {0, 0, 0}));
  builder.add_shape("outer", shape(ShapeType::kSphere, {0.1, 0, 0}));
  const ModelPtr fork = builder.build(BaseType::kFloating);
  const TreeLayout tree(*fork, 1);
  const bool expected[] = {false, true, false, true};
  for (int joint = 0; joint < 4; ++joint) {
    const std::string child = children[joint];
    for (int j = 0; j < 4; ++j)
      if (fork->joints()[j].name == "to_" + child)
        CHECK(tree.slots[tree.link_of_body[j + 1].slot].carries == expected[joint]);
  }
}

TEST(TurningABodyKeepsLengthsAndMasses) {
  const ModelPtr robot = testing::random_robot(5, 9, 0, BaseType::kFloating);
  const TreeLayout tree(*robot, 4);
  for (int body = 1; body <= 9; ++body) {
    const Vector3 p = tree.turned(body, {0.1, -0.2, 0.3});
    CHECK_NEAR(p[0] * p[0] + p[1] * p[1] + p[2] * p[2], 0.14, 1e-15);
    const Inertial& in = robot->bodies()[body].inertial;
    const auto turned = tree.turned_inertia(body, in);
    CHECK(turned.mass == in.mass);
    CHECK_NEAR(trace(turned.inertia), trace(in.inertia.data()), 1e-15);
    // The joint's axis is z of the turned frame.
    const Vector3 z = tree.turned(body, robot->joints()[body - 1].axis);
    CHECK_NEAR(z[2], 1, 1e-15);
  }
}

TEST(SupportPointsAreNumberedFromShapeToShapeAndMeshesHaveNone) {
  const ModelPtr robot = shapes_on_two_links(BaseType::kFloating);
  const auto shapes = layout::ground_shapes(*robot, TreeLayout(*robot, 1));
  CHECK(shapes.size() == 4 && layout::total_points(shapes) == 19);
  const int points[] = {8, 1, 8, 2}, of_model[] = {0, 1, 3, 4};
  int first = 0;
  for (size_t k = 0; k < shapes.size(); ++k) {
    CHECK(shapes[k].num_points == points[k] && shapes[k].first_point == first);
    CHECK(shapes[k].shape == of_model[k] && shapes[k].body == (k == 0 ? 0 : 1));
    first += points[k];
  }
  CHECK(layout::unsupported_shapes(*robot) == std::vector<int>{2});
}

TEST(ShapesOfAFixedBaseMeetNothing) {
  const ModelPtr robot = shapes_on_two_links(BaseType::kFixed);
  const auto shapes = layout::ground_shapes(*robot, TreeLayout(*robot, 1));
  CHECK(shapes.size() == 3 && shapes[0].body == 1 && layout::total_points(shapes) == 11);
}

TEST(EveryPointOfAShapeIsWithinItsBoundingRadius) {
  const ModelPtr robot = shapes_on_two_links(BaseType::kFloating);
  const auto shapes = layout::ground_shapes(*robot, TreeLayout(*robot, 1));
  CHECK_NEAR(shapes[0].bounding_radius, std::sqrt(0.01 + 0.04 + 0.09), 1e-15);  // box
  CHECK(shapes[1].bounding_radius == 0.1 && shapes[1].radius == 0.1);           // sphere
  CHECK_NEAR(shapes[2].bounding_radius, std::sqrt(0.01 + 0.0225), 1e-15);       // cylinder
  CHECK(shapes[2].radius == 0);
  CHECK_NEAR(shapes[3].bounding_radius, 0.25, 1e-15);  // capsule
  CHECK(shapes[3].radius == 0.1);
}
