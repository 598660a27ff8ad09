// Bad robot descriptions: each kind gets an error that names the file, the line, the element and
// the trouble.
#include <stickslip/errors.h>
#include <stickslip/model.h>

#include <cstdio>
#include <fstream>
#include <string>

#include "check.h"

using namespace stickslip;

namespace {

const std::string kInertial =
    "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' "
    "izz='1'/></inertial>";

std::string inertial(const std::string& mass, const std::string& ixx, const std::string& iyy,
                     const std::string& izz, const std::string& ixy = "0") {
  return "<inertial><mass value='" + mass + "'/><inertia ixx='" + ixx + "' ixy='" + ixy +
         "' ixz='0' iyy='" + iyy + "' iyz='0' izz='" + izz + "'/></inertial>";
}

std::string link_xml(const std::string& name, const std::string& content = kInertial) {
  return "<link name='" + name + "'>" + content + "</link>\n";
}

std::string joint_xml(const std::string& name, const std::string& parent, const std::string& child,
                      const std::string& type = "continuous",
                      const std::string& content = "<axis xyz='0 0 1'/>") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/>" + content + "</joint>\n";
}

// The content starts at line 2.
std::string robot(const std::string& content) {
  return "<robot name='r'>\n" + content + "</robot>";
}

void load_text(const std::string& content) {
  parse_urdf(robot(content), BaseType::kFloating, "r.urdf");
}

// A sound two-link robot whose joint or arm link is replaced.
std::string with_joint(const std::string& j) { return link_xml("base") + link_xml("arm") + j; }
std::string with_arm(const std::string& content) {
  return link_xml("base") + link_xml("arm", content) + joint_xml("j", "base", "arm");
}

}  // namespace

TEST(SoundRobotLoads) {
  const ModelPtr model = parse_urdf(robot(with_joint(joint_xml("j", "base", "arm"))));
  CHECK(model->num_joints() == 1);
  CHECK(model->warnings().empty());
}

TEST(MissingFileIsAFileError) {
  CHECK_THROWS(load_urdf("/no/such/robot.urdf"), FileError,
               "/no/such/robot.urdf: there is no such file");
}

TEST(FolderIsAFileError) { CHECK_THROWS(load_urdf("/"), FileError, "this is a folder"); }

TEST(EmptyFileIsNamed) {
  const std::string path = "stickslip_empty_test.urdf";
  std::ofstream(path).close();
  CHECK_THROWS(load_urdf(path), ModelError, "stickslip_empty_test.urdf: the file is empty");
  std::remove(path.c_str());
}

TEST(FileErrorsNameTheFile) {
  const std::string path = "stickslip_bad_test.urdf";
  std::ofstream(path) << robot(with_arm(""));
  CHECK_THROWS(load_urdf(path), ModelError, "stickslip_bad_test.urdf:3: link 'arm'");
  std::remove(path.c_str());
}

TEST(MalformedXmlNamesTheLine) {
  CHECK_THROWS(load_text("<link name='base'>\n<inertial>\n</link>\n"), ModelError,
               "r.urdf:3: this is not well-formed XML");
  CHECK_THROWS(parse_urdf(""), ModelError, "not well-formed XML");
  CHECK_THROWS(parse_urdf("a robot"), ModelError, "<string>");
  CHECK_THROWS(parse_urdf("<robot name='r'"), ModelError, "not well-formed XML");
}

TEST(OtherXmlIsRefused) {
  CHECK_THROWS(parse_urdf("<mujoco/>"), ModelError, "the root element is <mujoco>");
  CHECK_THROWS(parse_urdf("<robot><link name='a'/></robot>"), ModelError,
               "<robot> has no attribute 'name'");
  CHECK_THROWS(parse_urdf("<robot name='r'/>"), ModelError, "has no links");
  CHECK_THROWS(load_text("<xacro:leg side='left'/>"), ModelError, "expand the file first");
  CHECK_THROWS(
      load_text(with_joint(joint_xml("j", "base", "arm", "continuous", "<axis xyz='0 0 ${z}'/>"))),
      ModelError, "expand the xacro file first");
}

TEST(JointTypesAreChecked) {
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "screw"))), ModelError,
               "r.urdf:4: joint 'j': its type 'screw' is unknown");
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "floating"))), ModelError,
               "joint 'j': its type 'floating'");
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "planar"))), ModelError,
               "joint 'j': its type 'planar'");
  CHECK_THROWS(load_text(with_joint("<joint name='j'/>")), ModelError,
               "joint 'j': <joint> has no attribute 'type'");
}

TEST(JointNeedsAxisAndLimits) {
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "continuous", ""))), ModelError,
               "r.urdf:4: joint 'j'");
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "continuous", ""))), ModelError,
               "needs an axis");
  CHECK_THROWS(
      load_text(with_joint(joint_xml("j", "base", "arm", "continuous", "<axis xyz='0 0 0'/>"))),
      ModelError, "its axis is zero");
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "revolute"))), ModelError,
               "needs a <limit>");
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "revolute",
                                              "<axis xyz='0 0 1'/><limit lower='0'/>"))),
               ModelError, "<limit> has no attribute 'effort'");
  const std::string crossed =
      "<axis xyz='0 0 1'/><limit lower='1' upper='-1' effort='1' velocity='1'/>";
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "revolute", crossed))),
               ModelError, "r.urdf:4: joint 'j': its lower limit 1 exceeds its upper limit -1");
  const std::string negative = "<axis xyz='0 0 1'/><dynamics damping='-1'/>";
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "continuous", negative))),
               ModelError, "its damping is -1");
  const std::string weak = "<axis xyz='0 0 1'/><limit effort='-3' velocity='1'/>";
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "continuous", weak))), ModelError,
               "its effort limit is -3");
}

TEST(MassMustBePositive) {
  CHECK_THROWS(load_text(with_arm(inertial("-1", "1", "1", "1"))), ModelError,
               "r.urdf:3: link 'arm': its mass is -1 kg");
  CHECK_THROWS(load_text(with_arm(inertial("0", "1", "1", "1"))), ModelError,
               "r.urdf:3: link 'arm': the body that joint 'j' moves has no mass");
  CHECK_THROWS(load_text(with_arm("")), ModelError,
               "link 'arm': the body that joint 'j' moves has no mass");
  CHECK_THROWS(load_text(link_xml("base", "")), ModelError,
               "link 'base': the floating base has no mass");
}

TEST(FixedBaseNeedsNoMass) {
  const std::string text =
      robot(link_xml("base", "") + link_xml("arm") + joint_xml("j", "base", "arm"));
  CHECK_NEAR(parse_urdf(text, BaseType::kFixed)->mass(), 1, 0);
}

TEST(InertiaMustBePhysical) {
  CHECK_THROWS(load_text(with_arm(inertial("1", "1", "-1", "1"))), ModelError,
               "r.urdf:3: link 'arm'");
  CHECK_THROWS(load_text(with_arm(inertial("1", "1", "-1", "1"))), ModelError,
               "not positive definite");
  CHECK_THROWS(load_text(with_arm(inertial("1", "0", "0", "0"))), ModelError,
               "not positive definite");
  CHECK_THROWS(load_text(with_arm(inertial("1", "1", "1", "1", "1"))), ModelError,
               "not positive definite");
  CHECK_THROWS(load_text(with_arm(inertial("1", "1", "1", "2.1"))), ModelError,
               "breaks the triangle inequality");
}

TEST(RoundedFlatPlateIsAccepted) {
  // A plate: exactly izz = ixx + iyy. Rounded to three digits, 0.333 + 0.333 misses 0.667 by 0.15
  // %.
  load_text(with_arm(inertial("1", "0.333", "0.333", "0.667")));
  load_text(with_arm(inertial("1", "1", "1", "2")));
}

TEST(BrokenLinkIsBlamedNotTheOneItIsFixedTo) {
  const std::string text = link_xml("base") +
                           link_xml("arm", inertial("1", "1e-3", "1e-3", "1e-3")) +
                           link_xml("tool", inertial("1", "1", "1", "9")) +
                           joint_xml("j", "base", "arm") + joint_xml("f", "arm", "tool", "fixed");
  CHECK_THROWS(load_text(text), ModelError,
               "r.urdf:4: link 'tool': the inertia of the body that joint 'j' moves");
}

TEST(MassAndInertiaOfMereFramesDoNotMatter) {
  const std::string text = link_xml("base") + link_xml("imu", inertial("0", "0", "0", "0")) +
                           joint_xml("f", "base", "imu", "fixed");
  const ModelPtr model = parse_urdf(robot(text));
  CHECK(model->warnings().empty());
  CHECK(model->bodies()[0].inertial.inertia == (std::array<double, 6>{1, 0, 0, 1, 0, 1}));
}

TEST(BrokenPartOfASoundBodyIsAWarning) {
  const std::string text = link_xml("base") +
                           link_xml("camera", inertial("1", "0.1", "0.1", "0.5")) +
                           joint_xml("f", "base", "camera", "fixed");
  const ModelPtr model = parse_urdf(robot(text));
  CHECK(model->warnings().size() == 1);
  CHECK(model->warnings()[0].find("link 'camera': its inertia breaks the triangle inequality") ==
        0);
}

TEST(NamesMustBeUnique) {
  CHECK_THROWS(load_text(link_xml("base") + link_xml("base")), ModelError,
               "r.urdf:3: link 'base': two links have this name");
  CHECK_THROWS(load_text(link_xml("a") + link_xml("b") + link_xml("c") + joint_xml("j", "a", "b") +
                         joint_xml("j", "a", "c")),
               ModelError, "r.urdf:6: joint 'j': two joints have this name");
  CHECK_THROWS(load_text("<link/>"), ModelError, "r.urdf:2: <link> has no attribute 'name'");
}

TEST(TheTreeMustBeATree) {
  const std::string abc = link_xml("a") + link_xml("b") + link_xml("c");
  CHECK_THROWS(load_text(abc + joint_xml("j", "a", "b")), ModelError,
               "r.urdf:4: link 'c': is a second root beside 'a'");
  CHECK_THROWS(load_text(abc + joint_xml("j", "a", "b") + joint_xml("k", "c", "b")), ModelError,
               "r.urdf:3: link 'b': is the child of two joints, 'j' and 'k'");
  CHECK_THROWS(load_text(abc + joint_xml("j", "a", "b") + joint_xml("k", "b", "c") +
                         joint_xml("l", "c", "a")),
               ModelError, "loop of joints: 'a' -> 'b' -> 'c' -> 'a'");
  CHECK_THROWS(load_text(abc + joint_xml("k", "b", "c") + joint_xml("l", "c", "b")), ModelError,
               "link 'b': hangs on a loop");
  CHECK_THROWS(load_text(link_xml("a") + joint_xml("j", "a", "a")), ModelError,
               "joint 'j': connects link 'a' to itself");
  CHECK_THROWS(load_text(link_xml("a") + joint_xml("j", "a", "ghost")), ModelError,
               "joint 'j': its child link 'ghost' does not");
  CHECK_THROWS(load_text(link_xml("a") + joint_xml("j", "ghost", "a")), ModelError,
               "joint 'j': its parent link 'ghost' does not");
  CHECK_THROWS(load_text(link_xml("a") + "<joint name='j' type='fixed'><child link='a'/></joint>"),
               ModelError, "<joint> has no <parent>");
}

TEST(NumbersMustBeFiniteNumbers) {
  CHECK_THROWS(load_text(with_arm(inertial("nan", "1", "1", "1"))), ModelError,
               "'nan' is not a finite number");
  CHECK_THROWS(load_text(with_arm(inertial("1", "inf", "1", "1"))), ModelError,
               "'inf' is not a finite number");
  CHECK_THROWS(load_text(with_arm(inertial("1", "1e999", "1", "1"))), ModelError,
               "'1e999' is not a finite number");
  CHECK_THROWS(load_text(with_arm(inertial("heavy", "1", "1", "1"))), ModelError,
               "'heavy' is not a number");
  CHECK_THROWS(load_text(with_arm(inertial("1kg", "1", "1", "1"))), ModelError,
               "'1kg' is not a number");
  CHECK_THROWS(load_text(with_arm(inertial("1 2", "1", "1", "1"))), ModelError,
               "1 number expected, 2 found");
  CHECK_THROWS(
      load_text(with_joint(joint_xml("j", "base", "arm", "continuous", "<axis xyz='0 1'/>"))),
      ModelError, "3 numbers expected, 2 found");
  CHECK_THROWS(load_text(with_joint(joint_xml("j", "base", "arm", "continuous",
                                              "<axis xyz='0 0 1'/><origin rpy='0 0 x'/>"))),
               ModelError, "<origin> has rpy=\"0 0 x\"");
}

TEST(InertialMustBeComplete) {
  CHECK_THROWS(load_text(link_xml("a", "<inertial><mass value='1'/></inertial>")), ModelError,
               "<inertial> has no <inertia>");
  CHECK_THROWS(load_text(link_xml("a", "<inertial/>")), ModelError, "<inertial> has no <mass>");
  CHECK_THROWS(load_text(link_xml("a", kInertial + kInertial)), ModelError,
               "<link> has a second <inertial>");
  CHECK_THROWS(load_text(link_xml("a", "<inertial><mass value='1'/><inertia ixx='1'/></inertial>")),
               ModelError, "<inertia> has no attribute 'ixy'");
}

TEST(ShapesMustHavePositiveSizes) {
  const auto shape = [](const std::string& geometry) {
    load_text(
        link_xml("a", kInertial + "<collision><geometry>" + geometry + "</geometry></collision>"));
  };
  CHECK_THROWS(shape("<sphere radius='-1'/>"), ModelError,
               "r.urdf:2: link 'a': <sphere> has radius=\"-1\"");
  CHECK_THROWS(shape("<box size='1 0 1'/>"), ModelError, "sizes must be positive");
  CHECK_THROWS(shape("<box size='1 1'/>"), ModelError, "3 numbers expected, 2 found");
  CHECK_THROWS(shape("<cylinder radius='1'/>"), ModelError, "<cylinder> has no attribute 'length'");
  CHECK_THROWS(shape("<mesh/>"), ModelError, "<mesh> has no attribute 'filename'");
  CHECK_THROWS(shape("<mesh filename='a.stl' scale='1 0 1'/>"), ModelError, "scale");
  CHECK_THROWS(shape("<cone radius='1'/>"), ModelError, "unknown shape 'cone'");
  CHECK_THROWS(shape(""), ModelError, "<geometry> is empty");
}

TEST(WhatUrdfdomRefusesIsReported) {
  const std::string text = "<robot name='r' version='7.1'>" + link_xml("a") + "</robot>";
  CHECK_THROWS(parse_urdf(text, BaseType::kFloating, "r.urdf"), ModelError,
               "r.urdf: urdfdom cannot read this");
}

TEST(VisualsCannotFail) {
  load_text(link_xml("a", kInertial + "<visual><geometry><teapot/></geometry></visual>") +
            "<gazebo><joint name='x'/></gazebo>");
}
