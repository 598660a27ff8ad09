#include "model/urdf_xml.h"

#include <stickslip/errors.h>
#include <stickslip/model_builder.h>
#include <tinyxml2.h>

#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <sstream>

#include "model/tree.h"

namespace stickslip {
namespace {

using tinyxml2::XMLElement;

class UrdfChecker {
 public:
  UrdfChecker(tinyxml2::XMLDocument& document, const std::string& source)
      : document_(document), source_(source) {}
  UrdfText run();

 private:
  [[noreturn]] void fail(const XMLElement* at, const std::string& what) const;
  std::string attribute(const XMLElement* element, const char* name) const;
  std::vector<double> numbers(XMLElement* element, const char* name, size_t count) const;
  double number(XMLElement* element, const char* name) const {
    return numbers(element, name, 1)[0];
  }
  void positive(XMLElement* element, const char* name, size_t count) const;
  XMLElement* only_child(XMLElement* element, const char* name, bool required) const;
  void check_robot(const XMLElement* robot);
  void check_link(XMLElement* link);
  void check_joint(XMLElement* joint);
  void check_origin(XMLElement* parent) const;
  void check_inertial(XMLElement* inertial) const;
  void check_collision(XMLElement* collision);
  void check_limit(XMLElement* joint, const std::string& type) const;
  void check_dynamics(XMLElement* joint) const;

  tinyxml2::XMLDocument& document_;
  const std::string& source_;
  std::string owner_;    // "link 'torso'": what errors name
  std::string version_;  // of the URDF format
  bool has_capsule_ = false;
  std::vector<std::string> links_;
  std::vector<LinkJoint> joints_;
  UrdfText result_;
};

std::string tag(const XMLElement* element) { return std::string("<") + element->Name() + ">"; }

// Deletes all children but those named, so that what nobody reads cannot fail later.
void keep_children(XMLElement* element, std::initializer_list<const char*> names) {
  for (tinyxml2::XMLNode* child = element->FirstChild(); child;) {
    tinyxml2::XMLNode* next = child->NextSibling();
    bool keep = false;
    if (const XMLElement* e = child->ToElement())
      for (const char* name : names) keep = keep || std::strcmp(e->Name(), name) == 0;
    if (!keep) element->DeleteChild(child);
    child = next;
  }
}

void UrdfChecker::fail(const XMLElement* at, const std::string& what) const {
  const std::string owner = owner_.empty() ? "" : owner_ + ": ";
  throw ModelError(source_ + ":" + std::to_string(at->GetLineNum()) + ": " + owner + what);
}

std::string UrdfChecker::attribute(const XMLElement* element, const char* name) const {
  const char* value = element->Attribute(name);
  if (!value || !*value) fail(element, tag(element) + " has no attribute '" + name + "'; add it");
  return value;
}

// Reads exactly `count` finite numbers, and writes the attribute back in the one form that urdfdom
// reads.
std::vector<double> UrdfChecker::numbers(XMLElement* element, const char* name,
                                         size_t count) const {
  const std::string text = attribute(element, name);
  std::istringstream words(text);
  std::vector<double> values;
  std::string word, tidy;
  while (words >> word) {
    if (word[0] == '+') word.erase(0, 1);
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    const std::string where = tag(element) + " has " + name + "=\"" + text + "\"";
    if (error == std::errc::invalid_argument || end != word.data() + word.size()) {
      const bool xacro =
          word.find("${") != std::string::npos || word.find("$(") != std::string::npos;
      fail(element, where + ": '" + word + "' is not a number" +
                        (xacro ? "; expand the xacro file first" : ""));
    }
    if (error != std::errc() || !std::isfinite(value))
      fail(element, where + ": '" + word + "' is not a finite number");
    values.push_back(value);
    tidy += (tidy.empty() ? "" : " ") + word;
  }
  if (values.size() != count)
    fail(element, tag(element) + " has " + name + "=\"" + text + "\": " + std::to_string(count) +
                      " number" + (count == 1 ? "" : "s") + " expected, " +
                      std::to_string(values.size()) + " found");
  element->SetAttribute(name, tidy.c_str());
  return values;
}

void UrdfChecker::positive(XMLElement* element, const char* name, size_t count) const {
  for (double value : numbers(element, name, count))
    if (!(value > 0))
      fail(element, tag(element) + " has " + name + "=\"" + element->Attribute(name) +
                        "\": sizes must be positive");
}

XMLElement* UrdfChecker::only_child(XMLElement* element, const char* name, bool required) const {
  XMLElement* child = element->FirstChildElement(name);
  if (!child && required) fail(element, tag(element) + " has no <" + name + ">; add one");
  if (child)
    if (const XMLElement* second = child->NextSiblingElement(name))
      fail(second, tag(element) + " has a second <" + name + ">; keep one");
  return child;
}

void UrdfChecker::check_origin(XMLElement* parent) const {
  XMLElement* origin = only_child(parent, "origin", false);
  if (!origin) return;
  if (origin->Attribute("xyz")) numbers(origin, "xyz", 3);
  if (origin->Attribute("rpy")) numbers(origin, "rpy", 3);
  if (origin->Attribute("quat_xyzw")) {
    numbers(origin, "quat_xyzw", 4);
    if (version_ == "1.0")
      fail(origin, "<origin> has quat_xyzw, which needs <robot version=\"1.1\">");
  }
}

void UrdfChecker::check_inertial(XMLElement* inertial) const {
  check_origin(inertial);
  XMLElement* mass = only_child(inertial, "mass", true);
  if (number(mass, "value") < 0)
    fail(mass,
         std::string("its mass is ") + mass->Attribute("value") + " kg; a mass cannot be negative");
  XMLElement* inertia = only_child(inertial, "inertia", true);
  for (const char* name : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}) number(inertia, name);
}

void UrdfChecker::check_collision(XMLElement* collision) {
  keep_children(collision, {"origin", "geometry"});
  check_origin(collision);
  XMLElement* geometry = only_child(collision, "geometry", true);
  XMLElement* shape = geometry->FirstChildElement();
  if (!shape)
    fail(geometry,
         "<geometry> is empty; give it a box, sphere, cylinder, capsule or mesh, or delete the "
         "<collision>");
  const std::string type = shape->Name();
  if (type == "box") {
    positive(shape, "size", 3);
  } else if (type == "sphere") {
    positive(shape, "radius", 1);
  } else if (type == "cylinder" || type == "capsule") {
    positive(shape, "radius", 1);
    positive(shape, "length", 1);
    has_capsule_ = has_capsule_ || type == "capsule";
  } else if (type == "mesh") {
    attribute(shape, "filename");
    if (shape->Attribute("scale")) numbers(shape, "scale", 3);
  } else {
    fail(shape, "<geometry> has the unknown shape '" + type +
                    "'; use box, sphere, cylinder, capsule or mesh");
  }
}

void UrdfChecker::check_link(XMLElement* link) {
  owner_.clear();
  const std::string name = attribute(link, "name");
  owner_ = link_named(name);
  result_.lines.emplace_back(owner_, link->GetLineNum());
  links_.push_back(name);
  keep_children(link, {"inertial", "collision"});
  if (XMLElement* inertial = only_child(link, "inertial", false)) check_inertial(inertial);
  for (XMLElement* c = link->FirstChildElement("collision"); c;
       c = c->NextSiblingElement("collision"))
    check_collision(c);
}

void UrdfChecker::check_limit(XMLElement* joint, const std::string& type) const {
  XMLElement* limit = only_child(joint, "limit", false);
  if (!limit) {
    if (type != "continuous")
      fail(joint, "a " + type + " joint needs a <limit>; add one" +
                      (type == "revolute" ? ", or make the joint continuous" : ""));
    return;
  }
  for (const char* name : {"lower", "upper"})
    if (limit->Attribute(name)) number(limit, name);
  for (const char* name : {"effort", "velocity"})
    if (limit->Attribute(name) || version_ != "1.2") number(limit, name);
}

void UrdfChecker::check_dynamics(XMLElement* joint) const {
  XMLElement* dynamics = only_child(joint, "dynamics", false);
  if (!dynamics) return;
  bool any = false;
  for (const char* name : {"damping", "friction"})
    if (dynamics->Attribute(name)) {
      number(dynamics, name);
      any = true;
    }
  if (!any) joint->DeleteChild(dynamics);  // urdfdom refuses an empty one, which says nothing
}

void UrdfChecker::check_joint(XMLElement* joint) {
  owner_.clear();
  LinkJoint skeleton;
  skeleton.name = attribute(joint, "name");
  owner_ = joint_named(skeleton.name);
  result_.lines.emplace_back(owner_, joint->GetLineNum());
  const std::string type = attribute(joint, "type");
  if (type == "floating" || type == "planar")
    fail(joint,
         "its type '" + type +
             "' is not supported; use revolute, continuous, prismatic or fixed joints" +
             (type == "floating" ? " (a floating base is an option of the loader, not a joint)"
                                 : ""));
  if (type != "revolute" && type != "continuous" && type != "prismatic" && type != "fixed")
    fail(joint, "its type '" + type + "' is unknown; use revolute, continuous, prismatic or fixed");
  skeleton.parent = attribute(only_child(joint, "parent", true), "link");
  skeleton.child = attribute(only_child(joint, "child", true), "link");
  check_origin(joint);
  if (const XMLElement* mimic = joint->FirstChildElement("mimic"); mimic && type != "fixed")
    result_.warnings.push_back(owner_ + ": it mimics joint '" +
                               (mimic->Attribute("joint") ? mimic->Attribute("joint") : "") +
                               "', but is simulated as an independent joint");
  if (type == "fixed") {
    keep_children(joint, {"origin", "parent", "child"});
  } else {
    keep_children(joint, {"origin", "parent", "child", "axis", "limit", "dynamics"});
    XMLElement* axis = only_child(joint, "axis", false);
    if (!axis)
      fail(joint,
           "a " + type + " joint needs an axis; add <axis xyz=\"1 0 0\"/> or the direction meant");
    const std::vector<double> a = numbers(axis, "xyz", 3);
    if (a[0] == 0 && a[1] == 0 && a[2] == 0)
      fail(axis, "its axis is zero; give the direction it turns about or slides along");
    check_limit(joint, type);
    check_dynamics(joint);
  }
  joints_.push_back(skeleton);
}

void UrdfChecker::check_robot(const XMLElement* robot) {
  if (!robot || std::strcmp(robot->Name(), "robot") != 0)
    throw ModelError(source_ + ": the root element is " + (robot ? tag(robot) : "missing") +
                     ", but a URDF has <robot>; is this another kind of file?");
  version_ = robot->Attribute("version") ? robot->Attribute("version") : "1.0";
  result_.robot_name = attribute(robot, "name");
  for (const XMLElement* e = robot->FirstChildElement(); e; e = e->NextSiblingElement())
    if (std::strncmp(e->Name(), "xacro:", 6) == 0)
      fail(e,
           tag(e) +
               " is an instruction of xacro; expand the file first (xacro file.xacro > file.urdf)");
}

UrdfText UrdfChecker::run() {
  XMLElement* robot = document_.RootElement();
  check_robot(robot);
  keep_children(robot, {"link", "joint"});
  for (XMLElement* e = robot->FirstChildElement(); e; e = e->NextSiblingElement())
    std::strcmp(e->Name(), "link") == 0 ? check_link(e) : check_joint(e);
  owner_.clear();

  // The later of two elements with one name is the one that errors point at.
  std::map<std::string, int> line(result_.lines.begin(), result_.lines.end());
  for (const auto& [element, number] : result_.lines) line[element] = number;
  make_tree(links_, joints_, [&](const std::string& element, const std::string& what) {
    const int at = line.count(element) ? line[element] : robot->GetLineNum();
    throw ModelError(source_ + ":" + std::to_string(at) + ": " + element + ": " + what);
  });

  // urdfdom drops capsules from descriptions that say nothing of format 1.1; ours may have them
  // anyway.
  if (has_capsule_ && version_ == "1.0") robot->SetAttribute("version", "1.1");
  tinyxml2::XMLPrinter printer(nullptr, /*compact=*/true);
  document_.Print(&printer);
  result_.xml = printer.CStr();
  return std::move(result_);
}

}  // namespace

UrdfText check_urdf(const std::string& xml, const std::string& source) {
  tinyxml2::XMLDocument document;
  if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) {
    const int line = document.ErrorLineNum();
    throw ModelError(source + (line > 0 ? ":" + std::to_string(line) : "") +
                     ": this is not well-formed XML (" + document.ErrorName() +
                     "); an element may be unclosed or misspelled near this line");
  }
  return UrdfChecker(document, source).run();
}

}  // namespace stickslip
