// Owns the memory of one Tree<S>: made once per robot, so that a step allocates nothing.
#pragma once
#include <memory>
#include <vector>

#include "dynamics/tree.h"
#include "layout/tree_layout.h"

namespace stickslip::layout {

template <class S>
class TreeMemory {
 public:
  explicit TreeMemory(const Model& model)
      : layout_(model, dynamics::BundleScalar<S>::kLanes),
        constants_(layout_.num_slots),
        links_(layout_.num_slots) {
    write_constants(layout_, dynamics::BundleScalar<S>::kLanes,
                    reinterpret_cast<Value<S>*>(constants_.data()));
    tree_.floating = layout_.floating;
    tree_.num_bundles = static_cast<int>(layout_.bundles.size());
    tree_.num_slots = layout_.num_slots;
    tree_.num_joints = layout_.num_joints;
    tree_.bundles = layout_.bundles.data();
    tree_.slots = layout_.slots.data();
    tree_.constants = constants_.data();
    tree_.links = links_.data();
    tree_.inertias = nullptr;
    tree_.base = {};
    tree_.base_mass = constant<S>(layout_.base.mass);
    for (int k = 0; k < 3; ++k) tree_.base_com[k] = constant<S>(layout_.base.center_of_mass[k]);
    for (int k = 0; k < 6; ++k) tree_.base_inertia[k] = constant<S>(layout_.base.inertia[k]);
  }
  TreeMemory(const TreeMemory&) = delete;
  TreeMemory& operator=(const TreeMemory&) = delete;

  dynamics::Tree<S>& tree() { return tree_; }
  const TreeLayout& layout() const { return layout_; }

 private:
  TreeLayout layout_;
  std::vector<dynamics::LinkConstants<dynamics::WideConstant<S>>> constants_;
  std::vector<dynamics::LinkState<dynamics::Wide<S>>> links_;
  dynamics::Tree<S> tree_;
};

}  // namespace stickslip::layout
