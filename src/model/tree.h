// The tree of links that a description's joints span.
#pragma once
#include <stickslip/model_builder.h>

#include <functional>
#include <string>
#include <vector>

namespace stickslip {

/// Throws: `fail("link 'torso'", "what is wrong")`.
using Fail = std::function<void(const std::string& element, const std::string& what)>;

struct LinkTree {
  std::vector<int> order;         ///< links depth first, siblings by joint name; the root first
  std::vector<int> parent_joint;  ///< of each link; -1 for the root
  std::vector<int> parent_link;   ///< of each link; -1 for the root
};

/// Checks that names are unique and known and that the joints span one tree, and orders it.
LinkTree make_tree(const std::vector<std::string>& links, const std::vector<LinkJoint>& joints,
                   const Fail& fail);

inline std::string link_named(const std::string& name) { return "link '" + name + "'"; }
inline std::string joint_named(const std::string& name) { return "joint '" + name + "'"; }

}  // namespace stickslip
