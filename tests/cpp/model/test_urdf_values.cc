// What a URDF says arrives in the Model: joints, limits, shapes, order, and fixed joints merged.
#include <stickslip/errors.h>
#include <stickslip/model.h>

#include <cmath>
#include <string>

#include "check.h"

using namespace stickslip;

namespace {

const std::string kInertial =
    "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' "
    "izz='1'/></inertial>";

ModelPtr arm(const std::string& joint, const std::string& version = "") {
  return parse_urdf("<robot name='r'" + version + "><link name='base'>" + kInertial +
                    "</link><link name='arm'>" + kInertial + "</link><joint name='j' " + joint +
                    "<parent link='base'/><child link='arm'/></joint></robot>");
}

void check_vector(const Vector3& a, const Vector3& b, double tolerance) {
  for (int k = 0; k < 3; ++k) CHECK_NEAR(a[k], b[k], tolerance);
}

}  // namespace

TEST(RevoluteJointKeepsItsNumbers) {
  const ModelPtr model =
      arm("type='revolute'><origin xyz='1 2 3' rpy='0 0 1.5707963267948966'/><axis xyz='0 3 4'/>"
          "<limit lower='-1.5' upper='2' effort='80' velocity='15'/><dynamics damping='0.1' "
          "friction='0.2'/>");
  const Joint& joint = model->joints()[0];
  CHECK(joint.type == JointType::kRevolute);
  CHECK(joint.parent_body == 0 && model->bodies()[1].joint == 0);
  check_vector(joint.axis, {0, 0.6, 0.8}, 1e-15);
  check_vector(joint.pose.position, {1, 2, 3}, 0);
  CHECK_NEAR(joint.pose.rotation[1], -1, 1e-15);
  CHECK_NEAR(joint.pose.rotation[3], 1, 1e-15);
  CHECK(joint.lower == -1.5 && joint.upper == 2 && joint.effort_limit == 80 &&
        joint.velocity_limit == 15);
  CHECK(joint.damping == 0.1 && joint.friction == 0.2);
}

TEST(ContinuousJointHasNoPositionLimits) {
  const Joint joint = arm("type='continuous'><axis xyz='1 0 0'/><limit lower='-1' upper='1' "
                          "effort='2' velocity='3'/>")
                          ->joints()[0];
  CHECK(joint.type == JointType::kContinuous);
  CHECK(std::isinf(joint.lower) && joint.lower < 0 && std::isinf(joint.upper) && joint.upper > 0);
  CHECK(joint.effort_limit == 2 && joint.velocity_limit == 3);
  CHECK(std::isinf(arm("type='continuous'><axis xyz='1 0 0'/>")->joints()[0].effort_limit));
}

TEST(PrismaticJointIsRead) {
  const Joint joint = arm("type='prismatic'><axis xyz='1 0 0'/><limit lower='0' upper='0.3' "
                          "effort='2' velocity='3'/><dynamics/>")
                          ->joints()[0];
  CHECK(joint.type == JointType::kPrismatic);
  CHECK(joint.upper == 0.3);
}

TEST(NumbersMayHavePlusSignsTabsAndNewlines) {
  const Joint joint = arm("type='continuous'><axis xyz=' +0\t1\n0 '/>")->joints()[0];
  check_vector(joint.axis, {0, 1, 0}, 0);
}

TEST(MimicJointIsIndependentAndSaidSo) {
  const ModelPtr model = arm("type='continuous'><axis xyz='1 0 0'/><mimic joint='other'/>");
  CHECK(model->num_joints() == 1);
  CHECK(model->warnings().size() == 1 &&
        model->warnings()[0].find("joint 'j': it mimics joint 'other'") == 0);
}

TEST(QuaternionOriginNeedsFormat11) {
  const std::string quarter_turn =
      "type='continuous'><origin quat_xyzw='0 0 1 1'/><axis xyz='1 0 0'/>";
  CHECK_NEAR(arm(quarter_turn, " version='1.1'")->joints()[0].pose.rotation[3], 1, 1e-15);
  CHECK_THROWS(arm(quarter_turn), ModelError, "version=\"1.1\"");
}

TEST(ShapesAreKept) {
  const ModelPtr model = parse_urdf(
      "<robot name='r'><link name='a'>" + kInertial +
      "<collision><geometry><box size='1 2 3'/></geometry></collision>"
      "<collision><origin xyz='0 0 1'/><geometry><sphere radius='0.5'/></geometry></collision>"
      "<collision><geometry><cylinder radius='0.1' length='2'/></geometry></collision>"
      "<collision><geometry><capsule radius='0.2' length='3'/></geometry></collision>"
      "<collision><geometry><mesh filename='package://r/a.stl' scale='1 -1 "
      "2'/></geometry></collision></link></robot>");
  const std::vector<Shape>& shapes = model->shapes();
  CHECK(shapes.size() == 5);
  CHECK(shapes[0].type == ShapeType::kBox && shapes[0].name == "a/0");
  check_vector(shapes[0].size, {1, 2, 3}, 0);
  CHECK(shapes[1].type == ShapeType::kSphere && shapes[1].name == "a/1" &&
        shapes[1].size[0] == 0.5);
  check_vector(shapes[1].pose.position, {0, 0, 1}, 0);
  CHECK(shapes[2].type == ShapeType::kCylinder && shapes[2].size[0] == 0.1 &&
        shapes[2].size[1] == 2);
  CHECK(shapes[3].type == ShapeType::kCapsule && shapes[3].size[0] == 0.2 &&
        shapes[3].size[1] == 3);
  CHECK(shapes[4].type == ShapeType::kMesh && shapes[4].mesh_file == "package://r/a.stl");
  check_vector(shapes[4].mesh_scale, {1, -1, 2}, 0);
}

TEST(AnymalHas13BodiesAndItsMass) {
  const ModelPtr model = load_urdf(STICKSLIP_ASSETS "/anymal_b/anymal_b.urdf");
  CHECK(model->bodies().size() == 13 && model->num_joints() == 12 && model->nq() == 19 &&
        model->nu() == 18);
  CHECK(model->warnings().empty());
  CHECK_NEAR(model->mass(), 30.4753974, 1e-6);
  const char* names[] = {"LF_HAA", "LF_HFE", "LF_KFE", "LH_HAA", "LH_HFE", "LH_KFE",
                         "RF_HAA", "RF_HFE", "RF_KFE", "RH_HAA", "RH_HFE", "RH_KFE"};
  for (int j = 0; j < 12; ++j) CHECK(model->joints()[j].name == names[j]);
  int feet = 0;
  for (const Shape& shape : model->shapes())
    feet += shape.type == ShapeType::kSphere && shape.size[0] == 0.031;
  CHECK(feet == 4 && model->shapes().size() == 5);
  const Frame& foot = model->frame("LF_FOOT");
  CHECK(model->bodies()[foot.body].name == "LF_SHANK");
  check_vector(foot.pose.position, {0.1, -0.02, -0.32125}, 1e-15);
  for (const Shape& shape : model->shapes())
    if (shape.name == "LF_FOOT/0") check_vector(shape.pose.position, {0.1, -0.02, -0.298}, 1e-15);
}
