// ModelBuilder: merging against hand computations, the order of the tree, and checks that need no
// file.
#include <stickslip/errors.h>
#include <stickslip/model_builder.h>

#include <cmath>
#include <limits>

#include "check.h"
#include "model/inertia.h"
#include "model/pose.h"

using namespace stickslip;

namespace {

const double kNan = std::numeric_limits<double>::quiet_NaN();
const Inertial kUnit{1, {0, 0, 0}, {1, 0, 0, 1, 0, 1}};

LinkJoint make(const std::string& name, const std::string& parent, const std::string& child,
               LinkJointType type = LinkJointType::kContinuous,
               const Vector3& position = {0, 0, 0}) {
  LinkJoint joint;
  joint.name = name;
  joint.parent = parent;
  joint.child = child;
  joint.type = type;
  joint.pose.position = position;
  return joint;
}

// base - j -> arm, the last one to be spoilt.
ModelBuilder two_links(const LinkJoint& joint = make("j", "base", "arm"),
                       const Inertial& arm = kUnit) {
  ModelBuilder builder("r", "r");
  builder.add_link("base", kUnit);
  builder.add_link("arm", arm);
  builder.add_joint(joint);
  return builder;
}

std::string numbered(std::string text, int k) { return text.append(std::to_string(k)); }

void check_vector(const Vector3& a, const Vector3& b, double tolerance) {
  for (int k = 0; k < 3; ++k) CHECK_NEAR(a[k], b[k], tolerance);
}

}  // namespace

TEST(TwoPointMassesMergeToADumbbell) {
  // Masses 1 and 3 kg at x = 0 and x = 4 m: center of mass 3 m, inertia 1 * 9 + 3 * 1 = 12 kg m^2
  // about y and z, plus their own.
  ModelBuilder builder("dumbbell");
  builder.add_link("left", Inertial{1, {0, 0, 0}, {0.1, 0, 0, 0.1, 0, 0.1}});
  builder.add_link("right", Inertial{3, {1, 0, 0}, {0.2, 0, 0, 0.3, 0, 0.4}});
  builder.add_joint(make("rod", "left", "right", LinkJointType::kFixed, {3, 0, 0}));
  const ModelPtr model = builder.build(BaseType::kFloating);
  CHECK(model->bodies().size() == 1 && model->frames().size() == 2);
  const Inertial& body = model->bodies()[0].inertial;
  CHECK_NEAR(body.mass, 4, 0);
  check_vector(body.center_of_mass, {3, 0, 0}, 1e-15);
  const double expected[] = {0.3, 0, 0, 12.4, 0, 12.5};
  for (int k = 0; k < 6; ++k) CHECK_NEAR(body.inertia[k], expected[k], 1e-14);
  CHECK(model->frame("right").body == 0);
  check_vector(model->frame("right").pose.position, {3, 0, 0}, 0);
}

TEST(MergedInertiaTurnsWithItsLink) {
  // A quarter turn about z swaps the x and y moments.
  ModelBuilder builder("turned");
  builder.add_link("hub");
  builder.add_link("plate", Inertial{2, {1, 0, 0}, {1, 0.1, 0.2, 2, 0.3, 2.5}});
  LinkJoint weld = make("weld", "hub", "plate", LinkJointType::kFixed, {0, 0, 5});
  weld.pose.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  builder.add_joint(weld);
  const Inertial body = builder.build(BaseType::kFloating)->bodies()[0].inertial;
  check_vector(body.center_of_mass, {0, 1, 5}, 0);
  const double expected[] = {2, -0.1, -0.3, 1, 0.2, 2.5};
  for (int k = 0; k < 6; ++k) CHECK_NEAR(body.inertia[k], expected[k], 1e-15);
}

TEST(ChainsOfFixedJointsMoveJointsShapesAndFrames) {
  // base -f1-> a -f2-> b -j-> c -f3-> tip; each step 1 m up, b turned by a quarter turn about x.
  ModelBuilder builder("chain");
  for (const char* name : {"base", "a", "b", "c", "tip"}) builder.add_link(name, kUnit);
  builder.add_joint(make("f1", "base", "a", LinkJointType::kFixed, {0, 0, 1}));
  LinkJoint f2 = make("f2", "a", "b", LinkJointType::kFixed, {0, 0, 1});
  f2.pose.rotation = {1, 0, 0, 0, 0, -1, 0, 1, 0};
  builder.add_joint(f2);
  builder.add_joint(make("j", "b", "c", LinkJointType::kPrismatic, {0, 0, 1}));
  builder.add_joint(make("f3", "c", "tip", LinkJointType::kFixed, {0, 0, 1}));
  Shape ball;
  ball.size = {0.5, 0, 0};
  ball.pose.position = {0, 0, 2};
  builder.add_shape("b", ball);
  builder.add_shape("tip", ball);
  const ModelPtr model = builder.build(BaseType::kFixed);
  CHECK(model->bodies().size() == 2 && model->frames().size() == 5 && model->num_joints() == 1);
  check_vector(model->joints()[0].pose.position, {0, -1, 2}, 1e-15);
  check_vector(model->frame("b").pose.position, {0, 0, 2}, 0);
  check_vector(model->frame("tip").pose.position, {0, 0, 1}, 0);
  CHECK(model->frame("tip").body == 1);
  CHECK(model->shapes()[0].body == 0 && model->shapes()[1].body == 1);
  check_vector(model->shapes()[0].pose.position, {0, -2, 2}, 1e-15);
  check_vector(model->shapes()[1].pose.position, {0, 0, 3}, 0);
  CHECK_NEAR(model->mass(), 2, 0);
  CHECK(model->nq() == 1 && model->nu() == 1);
}

TEST(SiblingsAreOrderedByJointNameDepthFirst) {
  // Links added in another order, and a fixed link between: its moving child takes the fixed
  // joint's place.
  ModelBuilder builder("tree");
  for (const char* name : {"z", "y", "x", "w", "base"}) builder.add_link(name, kUnit);
  builder.add_joint(make("b", "base", "z"));
  builder.add_joint(make("c", "base", "y"));
  builder.add_joint(make("a", "base", "x", LinkJointType::kFixed));
  builder.add_joint(make("zz", "x", "w"));
  const ModelPtr model = builder.build(BaseType::kFloating);
  CHECK(model->num_joints() == 3);
  const char* joints[] = {"zz", "b", "c"};
  const char* bodies[] = {"base", "w", "z", "y"};
  for (int j = 0; j < 3; ++j) {
    CHECK(model->joints()[j].name == joints[j]);
    CHECK(model->bodies()[j + 1].name == bodies[j + 1]);
    CHECK(model->bodies()[j + 1].joint == j);
    CHECK(model->joint_index(joints[j]) == j && model->body_index(bodies[j]) == j);
  }
}

TEST(ParentsComeBeforeChildrenInALongChain) {
  ModelBuilder builder("chain");
  const int n = 2000;
  for (int k = 0; k < n; ++k) builder.add_link(numbered("l", k), kUnit);
  for (int k = 1; k < n; ++k)
    builder.add_joint(make(numbered("j", k), numbered("l", k - 1), numbered("l", k)));
  const ModelPtr model = builder.build(BaseType::kFloating);
  for (int j = 0; j < model->num_joints(); ++j) CHECK(model->joints()[j].parent_body == j);
}

TEST(LookupsListTheNames) {
  const ModelPtr model =
      two_links(make("j", "base", "arm", LinkJointType::kFixed)).build(BaseType::kFloating);
  CHECK_THROWS(model->joint_index("k"), ModelError, "no moving joint 'k'; it has none");
  CHECK_THROWS(model->body_index("arm"), ModelError, "fixed to body 'base'");
  CHECK_THROWS(model->body_index("leg"), ModelError, "it has 'base'");
  CHECK_THROWS(model->frame("leg"), ModelError, "it has 'base', 'arm'");
}

TEST(AxisIsNormalized) {
  LinkJoint joint = make("j", "base", "arm");
  joint.axis = {0, 0, -5};
  check_vector(two_links(joint).build(BaseType::kFloating)->joints()[0].axis, {0, 0, -1}, 0);
}

TEST(BadNumbersNameTheElement) {
  LinkJoint joint = make("j", "base", "arm");
  joint.axis = {0, 0, 0};
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "r: joint 'j': its axis is zero");
  joint.axis = {kNan, 0, 0};
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "joint 'j': its axis has a number");
  joint = make("j", "base", "arm");
  joint.pose.position[1] = kNan;
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "joint 'j': its pose has a number");
  joint.pose = {};
  joint.pose.rotation[0] = -1;  // a mirror
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "joint 'j': the rotation of its pose");
  joint = make("j", "base", "arm");
  joint.lower = kNan;
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "joint 'j': a position limit");
  joint = make("j", "base", "arm");
  joint.effort_limit = kNan;
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "joint 'j': its effort limit is");
  joint = make("j", "base", "arm");
  joint.friction = -1;
  CHECK_THROWS(two_links(joint).build(BaseType::kFloating), ModelError,
               "joint 'j': its friction is -1");
  const Inertial hole{kNan, {0, 0, 0}, {1, 0, 0, 1, 0, 1}};
  CHECK_THROWS(two_links(make("j", "base", "arm"), hole).build(BaseType::kFloating), ModelError,
               "link 'arm': its mass");
}

TEST(OffsetsThatAddUpToInfinityNameTheLink) {
  ModelBuilder builder("far");
  for (const char* name : {"base", "a", "b"}) builder.add_link(name, kUnit);
  builder.add_joint(make("f", "base", "a", LinkJointType::kFixed, {1e308, 0, 0}));
  builder.add_joint(make("j", "a", "b", LinkJointType::kContinuous, {1e308, 0, 0}));
  CHECK_THROWS(builder.build(BaseType::kFixed), ModelError, "link 'b': its position overflows");
}

TEST(BadShapesNameTheLink) {
  ModelBuilder builder = two_links();
  Shape ball;
  CHECK_THROWS((builder.add_shape("arm", ball), builder.build(BaseType::kFloating)), ModelError,
               "link 'arm': a shape");
  builder = two_links();
  ball.size = {1, 0, 0};
  CHECK_THROWS((builder.add_shape("leg", ball), builder.build(BaseType::kFloating)), ModelError,
               "link 'leg': a shape is on this link, which does not exist");
}

TEST(BuilderIsUsableAfterAnError) {
  ModelBuilder builder("r");
  builder.add_link("base", kUnit);
  builder.add_link("arm", kUnit);
  CHECK_THROWS(builder.build(BaseType::kFloating), ModelError, "link 'arm': is a second root");
  builder.add_joint(make("j", "base", "arm"));
  CHECK(builder.build(BaseType::kFloating)->num_joints() == 1);
}

TEST(PrincipalMomentsOfATurnedBodyAreItsOwn) {
  const Matrix3 R = rotation_of_quaternion(0.5, -0.5, 0.1, std::sqrt(1 - 0.51));
  const Inertial turned = transform({R, {1, 2, 3}}, {1, {0, 0, 0}, {1, 0, 0, 2, 0, 2.5}});
  check_vector(principal_moments(turned.inertia), {1, 2, 2.5}, 1e-14);
}
