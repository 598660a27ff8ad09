#include "layout/tree_layout.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "layout/ground_shapes.h"
#include "model/pose.h"

namespace stickslip::layout {
namespace {

/// A rotation whose third column is the axis. Coordinate axes give exact permutations: positive
/// ones cyclic, negative ones with signs.
Matrix3 turn_onto_z(const Vector3& axis) {
  const auto size = [&](int i) { return std::abs(axis[i]); };
  const int largest = size(2) > std::max(size(0), size(1)) ? 2 : size(1) > size(0) ? 1 : 0;
  const int next = (largest + 1) % 3, other = (largest + 2) % 3;
  const int smallest = size(other) < size(next) ? other : next;
  Vector3 x{};
  const double along = axis[smallest];
  for (int i = 0; i < 3; ++i) x[i] = (i == smallest ? 1.0 : 0.0) - along * axis[i];
  const double n = std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
  for (double& v : x) v /= n;
  const Vector3 y{axis[1] * x[2] - axis[2] * x[1], axis[2] * x[0] - axis[0] * x[2],
                  axis[0] * x[1] - axis[1] * x[0]};
  return {x[0], y[0], axis[0], x[1], y[1], axis[1], x[2], y[2], axis[2]};
}

/// Slot::renaming of one lane.
int find_renaming(const Matrix3& r) {
  for (int by = 0; by < 3; ++by) {
    bool all = true;
    for (int row = 0; row < 3; ++row)
      for (int k = 0; k < 3; ++k) all = all && r[3 * row + k] == (row == (k + by) % 3);
    if (all) return by;
  }
  return -1;
}

/// A maximal serial chain of joints.
struct Chain {
  std::vector<int> joints;
  int parent_body;
  int level;          // chains between it and the base
  std::string shape;  // length and joint types
};

std::vector<Chain> find_chains(const Model& model) {
  const int n = model.num_joints();
  std::vector<std::vector<int>> children(n + 1);  // joints by parent body
  for (int j = 0; j < n; ++j) children[model.joints()[j].parent_body].push_back(j);
  std::vector<Chain> chains;
  std::vector<int> chain_of_body(n + 1, -1);
  for (int j = 0; j < n; ++j) {
    const int parent = model.joints()[j].parent_body;
    const char type = model.joints()[j].type == JointType::kPrismatic ? 'p' : 'r';
    if (parent != 0 && children[parent].size() == 1) {
      Chain& c = chains[chain_of_body[parent]];
      c.joints.push_back(j);
      c.shape += type;
      chain_of_body[j + 1] = chain_of_body[parent];
    } else {
      const int level = parent == 0 ? 0 : chains[chain_of_body[parent]].level + 1;
      chain_of_body[j + 1] = static_cast<int>(chains.size());
      chains.push_back({{j}, parent, level, std::string(1, type)});
    }
  }
  return chains;
}

}  // namespace

TreeLayout::TreeLayout(const Model& model, int lanes_per_bundle)
    : floating(model.base() == BaseType::kFloating), num_joints(model.num_joints()), num_slots(0) {
  turn.assign(model.bodies().size(), Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1});
  for (int j = 0; j < num_joints; ++j) {
    turn[j + 1] = turn_onto_z(model.joints()[j].axis);
    const int parent = model.joints()[j].parent_body;
    parent_joint.push_back(parent - 1);
  }
  link_of_body.resize(model.bodies().size());
  if (floating) base = model.bodies()[0].inertial;
  std::vector<bool> has_shape(model.bodies().size(), false);
  for (const Shape& s : model.shapes())
    if (makes_contact(s.type)) has_shape[s.body] = true;

  // Equal chains of one level, in the order of the model, side by side.
  std::map<std::pair<int, std::string>, std::vector<Chain>> groups;
  for (Chain& c : find_chains(model)) groups[{c.level, c.shape}].push_back(c);
  for (const auto& [key, chains] : groups)
    for (size_t first = 0; first < chains.size(); first += lanes_per_bundle) {
      dynamics::Bundle b{};
      b.first_slot = num_slots;
      b.length = static_cast<int>(chains[first].joints.size());
      b.lanes = static_cast<int>(std::min<size_t>(lanes_per_bundle, chains.size() - first));
      b.on_base = true;
      for (int k = 0; k < b.length; ++k) {
        dynamics::Slot slot{};
        slot.prismatic = key.second[k] == 'p';
        for (int lane = 0; lane < dynamics::kMaxLanes; ++lane) {
          const int j = chains[first + (lane < b.lanes ? lane : 0)].joints[k];
          slot.joint[lane] = j;
          slot.parent[lane] = link_of_body[model.joints()[j].parent_body];
          if (lane < b.lanes) link_of_body[j + 1] = {num_slots + k, lane};
          slot.carries = slot.carries || has_shape[j + 1];
        }
        slots.push_back(slot);
      }
      for (int lane = 0; lane < dynamics::kMaxLanes; ++lane) {
        const int parent = chains[first + (lane < b.lanes ? lane : 0)].parent_body;
        b.parent[lane] = link_of_body[parent];
        if (parent != 0) {
          b.on_base = false;
          for (dynamics::Bundle& above : bundles)  // a chain ends where others hang on it
            if (above.first_slot + above.length - 1 == b.parent[lane].slot)
              above.has_children = slots[b.parent[lane].slot].carries = true;
        }
      }
      num_slots += b.length;
      bundles.push_back(b);
    }

  links.resize(static_cast<size_t>(num_slots) * dynamics::kMaxLanes);
  for (int slot = 0; slot < num_slots; ++slot) {
    for (int lane = 0; lane < dynamics::kMaxLanes; ++lane) {
      const int j = slots[slot].joint[lane];
      const Joint& joint = model.joints()[j];
      const Inertial& in = model.bodies()[j + 1].inertial;
      dynamics::LinkConstants<double>& link = links[slot * dynamics::kMaxLanes + lane];
      const Matrix3 from_parent = transpose(turn[joint.parent_body]);
      const Matrix3 r = multiply(multiply(from_parent, joint.pose.rotation), turn[j + 1]);
      const Vector3 p = rotate(from_parent, joint.pose.position);
      std::copy(r.begin(), r.end(), link.rotation);
      std::copy(p.begin(), p.end(), link.position);
      link.inertial = turned_inertia(j + 1, in);
      const int renaming = find_renaming(r);
      if (lane == 0)
        slots[slot].renaming = renaming;
      else if (renaming != slots[slot].renaming)
        slots[slot].renaming = -1;
    }
  }
}

Vector3 TreeLayout::turned(int body, const Vector3& p) const {
  return rotate(transpose(turn[body]), p);
}

dynamics::LinkInertia<double> TreeLayout::turned_inertia(int body, const Inertial& in) const {
  const Vector3 c = turned(body, in.center_of_mass);
  const auto& i = in.inertia;
  const Matrix3 full{i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5]};
  const Matrix3 t = multiply(multiply(transpose(turn[body]), full), turn[body]);
  return {in.mass, {c[0], c[1], c[2]}, {t[0], t[1], t[2], t[4], t[5], t[8]}};
}

}  // namespace stickslip::layout
