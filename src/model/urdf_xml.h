// What urdfdom does not tell: this reads the same XML before it does, and names the element, line
// and remedy.
#pragma once
#include <string>
#include <utility>
#include <vector>

namespace stickslip {

struct UrdfText {
  std::string robot_name;
  std::string xml;  ///< only what a Model is made from, so that nothing else (visuals, plugins) can
                    ///< fail in urdfdom
  std::vector<std::pair<std::string, int>> lines;  ///< "link 'torso'" and where it is
  std::vector<std::string> warnings;
};

/// Checks every element of a URDF that a Model is made from: well-formed XML, required elements and
/// attributes, joint types, numbers, and that the joints span one tree. `source` is what errors
/// call the text. Throws ModelError.
UrdfText check_urdf(const std::string& xml, const std::string& source);

}  // namespace stickslip
