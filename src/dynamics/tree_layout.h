// Makes the bundles of branches (branches.h) of a Model, once per model. Host side: the kernels see
// only what it fills.
#pragma once
#include <stickslip/model.h>

#include <vector>

#include "dynamics/branches.h"
#include "spatial/vec3.h"

namespace stickslip::dynamics {

/// The layout of a Model for kernels with up to `lanes_per_bundle` branches side by side. Double;
/// made once per model.
struct TreeLayout {
  TreeLayout(const Model& model, int lanes_per_bundle);

  bool floating;
  int num_joints;
  int num_slots;
  std::vector<Bundle> bundles;  // parents before children
  std::vector<Slot> slots;
  std::vector<LinkIndex> link_of_body;
  std::vector<int> parent_joint;             // of each joint; -1 on the base
  std::vector<Matrix3> turn;                 // per body: turned link frame in the body frame
  std::vector<LinkConstants<double>> links;  // [slot * kMaxLanes + lane]
  Inertial base;                             // of body 0 (zero for a fixed base)

  /// A point of a body, in its turned link frame.
  Vector3 turned(int body, const Vector3& p) const;
  /// Mass properties of a body, given in its body frame as a Model does, in its turned link frame.
  /// Exact where the joint's axis is a coordinate axis.
  LinkInertia<double> turned_inertia(int body, const Inertial& inertial) const;
};

/// Packs the constants of a layout for the scalar S.
template <class S>
std::vector<LinkConstants<WideConstant<S>>> pack_constants(const TreeLayout& layout) {
  using K = WideConstant<S>;
  constexpr int kNumbers = sizeof(LinkConstants<double>) / sizeof(double);
  std::vector<LinkConstants<K>> out(layout.num_slots);
  for (int slot = 0; slot < layout.num_slots; ++slot)
    for (int lane = 0; lane < BundleScalar<S>::kLanes; ++lane) {
      const auto* from = reinterpret_cast<const double*>(&layout.links[slot * kMaxLanes + lane]);
      auto* to = reinterpret_cast<K*>(&out[slot]);
      for (int k = 0; k < kNumbers; ++k) set_lane(to[k], lane, static_cast<Value<S>>(from[k]));
    }
  return out;
}

}  // namespace stickslip::dynamics
