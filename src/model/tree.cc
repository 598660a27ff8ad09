#include "model/tree.h"

#include <algorithm>
#include <map>
#include <set>

namespace stickslip {
namespace {

using Index = std::map<std::string, int>;

Index index_links(const std::vector<std::string>& links, const Fail& fail) {
  if (links.empty())
    fail("robot", "has no links; add at least one <link> (a xacro file must be expanded first)");
  Index index;
  for (const std::string& name : links) {
    if (name.empty()) fail("a link", "has no name; give every link one");
    if (!index.emplace(name, static_cast<int>(index.size())).second)
      fail(link_named(name), "two links have this name; rename one");
  }
  return index;
}

void check_joint_names(const std::vector<LinkJoint>& joints, const Fail& fail) {
  std::set<std::string> names;
  for (const LinkJoint& joint : joints) {
    if (joint.name.empty()) fail("a joint", "has no name; give every joint one");
    if (!names.insert(joint.name).second)
      fail(joint_named(joint.name), "two joints have this name; rename one");
  }
}

int find_link(const Index& links, const LinkJoint& joint, const std::string& name, const char* role,
              const Fail& fail) {
  const auto found = links.find(name);
  if (found == links.end())
    fail(joint_named(joint.name), std::string("its ") + role + " link '" + name +
                                      "' does not exist; add that link or correct the name");
  return found->second;
}

// Sets parents; after it every link has at most one.
void connect(const Index& index, const std::vector<LinkJoint>& joints, LinkTree& tree,
             const Fail& fail) {
  for (size_t j = 0; j < joints.size(); ++j) {
    const LinkJoint& joint = joints[j];
    const int parent = find_link(index, joint, joint.parent, "parent", fail);
    const int child = find_link(index, joint, joint.child, "child", fail);
    if (parent == child)
      fail(joint_named(joint.name), "connects link '" + joint.child + "' to itself");
    if (tree.parent_joint[child] >= 0)
      fail(link_named(joint.child),
           "is the child of two joints, '" + joints[tree.parent_joint[child]].name + "' and '" +
               joint.name + "'; a link can have one parent only (loops cannot be described)");
    tree.parent_joint[child] = static_cast<int>(j);
    tree.parent_link[child] = parent;
  }
}

// Names the links of the loop that following the parents of `start` runs into.
std::string describe_loop(const std::vector<std::string>& links, const LinkTree& tree, int start) {
  for (size_t k = 0; k < links.size(); ++k)
    start = tree.parent_link[start];  // now surely on the loop
  std::string text = "'" + links[start] + "'";
  for (int l = tree.parent_link[start]; l != start; l = tree.parent_link[l])
    text = "'" + links[l] + "' -> " + text;
  return "'" + links[start] + "' -> " + text;
}

}  // namespace

LinkTree make_tree(const std::vector<std::string>& links, const std::vector<LinkJoint>& joints,
                   const Fail& fail) {
  const Index index = index_links(links, fail);
  check_joint_names(joints, fail);
  const int n = static_cast<int>(links.size());
  LinkTree tree;
  tree.parent_joint.assign(n, -1);
  tree.parent_link.assign(n, -1);
  connect(index, joints, tree, fail);

  // Children in reverse order of their joints' names, because the stack below turns them round.
  std::vector<std::vector<int>> children(n);
  std::vector<int> stack;
  for (int l = 0; l < n; ++l)
    (tree.parent_link[l] < 0 ? stack : children[tree.parent_link[l]]).push_back(l);
  for (std::vector<int>& siblings : children)
    std::sort(siblings.begin(), siblings.end(), [&](int a, int b) {
      return joints[tree.parent_joint[a]].name > joints[tree.parent_joint[b]].name;
    });

  const std::vector<int> roots = stack;
  std::vector<bool> seen(n, false);
  while (!stack.empty()) {
    const int l = stack.back();
    stack.pop_back();
    tree.order.push_back(l);
    seen[l] = true;
    stack.insert(stack.end(), children[l].begin(), children[l].end());
  }
  // What no root reaches hangs on a loop, since every link has one parent at most.
  const auto lost = std::find(seen.begin(), seen.end(), false);
  if (lost != seen.end())
    fail(link_named(links[lost - seen.begin()]),
         "hangs on a loop of joints: " +
             describe_loop(links, tree, static_cast<int>(lost - seen.begin())) +
             "; the joints must form a tree");
  if (roots.size() > 1)
    fail(link_named(links[roots[1]]),
         "is a second root beside '" + links[roots[0]] +
             "' (neither is the child of a joint); connect them, with a fixed joint for instance");
  return tree;
}

}  // namespace stickslip
