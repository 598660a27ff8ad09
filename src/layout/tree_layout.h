// Makes the bundles of branches (dynamics/branches.h) of a Model, once per model.
#pragma once
#include <stickslip/model.h>

#include <vector>

#include "dynamics/branches.h"

namespace stickslip::layout {

/// The layout of a Model for kernels with up to `lanes_per_bundle` branches side by side. Double;
/// made once per model.
struct TreeLayout {
  TreeLayout(const Model& model, int lanes_per_bundle);

  bool floating;
  int num_joints;
  int num_slots;
  std::vector<dynamics::Bundle> bundles;  // parents before children
  std::vector<dynamics::Slot> slots;
  std::vector<dynamics::LinkIndex> link_of_body;
  std::vector<int> parent_joint;  // of each joint; -1 on the base
  std::vector<Matrix3> turn;      // per body: turned link frame in the body frame
  std::vector<dynamics::LinkConstants<double>> links;  // [slot * dynamics::kMaxLanes + lane]
  Inertial base;                                       // of body 0 (zero for a fixed base)

  /// A point of a body, in its turned link frame.
  Vector3 turned(int body, const Vector3& p) const;
  /// Mass properties of a body, given in its body frame as a Model does, in its turned link frame.
  /// Exact where the joint's axis is a coordinate axis.
  dynamics::LinkInertia<double> turned_inertia(int body, const Inertial& inertial) const;
};

/// Numbers per slot of `write_constants`, for each lane of a bundle.
inline constexpr int kConstantsPerSlot = sizeof(dynamics::LinkConstants<double>) / sizeof(double);

/// The constants of a layout as kernels with so many lanes per bundle read them: T (slots,
/// kConstantsPerSlot, lanes), which is LinkConstants of each slot.
template <class T>
void write_constants(const TreeLayout& layout, int lanes, T* out) {
  for (int slot = 0; slot < layout.num_slots; ++slot)
    for (int k = 0; k < kConstantsPerSlot; ++k)
      for (int lane = 0; lane < lanes; ++lane) {
        const auto& link = layout.links[slot * dynamics::kMaxLanes + lane];
        *out++ = static_cast<T>(reinterpret_cast<const double*>(&link)[k]);
      }
}

}  // namespace stickslip::layout
