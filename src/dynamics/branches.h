// How the kernels see a Model: serial chains of equal shape bundled side by side, one chain per
// lane.
//
// A tree falls apart into maximal serial chains between branch points. Chains with the same length,
// the same joint types and parents at the same depth form a bundle and are computed in the lanes of
// one pack (ANYmal: one bundle of four 3-joint legs; a humanoid: two legs, two arms, trunk, head).
// A slot is one joint position of a bundle: `slot + lane` names a joint. When environments are the
// lanes (batches), a bundle holds one chain and the same kernels run on it.
//
// Link frames are turned at load so that every joint axis is z: a joint rotation then mixes two
// columns.
#pragma once
#include "lane/pack.h"

// Plain data, the same for every instruction set.
namespace stickslip::dynamics {

inline constexpr int kMaxLanes = 4;
inline constexpr int kBaseSlot = -1;  // parent slot of chains that hang on body 0

/// Where a body sits: slot kBaseSlot is body 0.
struct LinkIndex {
  int slot = kBaseSlot;
  int lane = 0;
};

struct Bundle {
  int first_slot;
  int length;                   // joints per chain
  int lanes;                    // chains in use; the rest repeat chain 0
  bool has_children;            // other bundles hang on its last slot
  LinkIndex parent[kMaxLanes];  // of each chain's first joint
  bool on_base;                 // all parents are body 0
};

struct Slot {
  bool prismatic;
  /// Other chains or shapes hang on a link: its pose and velocity are read after a walk.
  bool carries;
  /// Where every lane's LinkConstants::rotation only renames axes: its column k is the parent's
  /// axis (k + renaming) % 3. Else -1.
  int renaming;
  int joint[kMaxLanes];  // joint index of each lane
  LinkIndex parent[kMaxLanes];
};

/// Mass properties of one link in its turned frame.
template <class K>
struct LinkInertia {
  K mass;        // [kg]
  K com[3];      // [m]
  K inertia[6];  // xx xy xz yy yz zz about the center of mass [kg m^2]
};

/// Constants of one link, axes turned. K is a pack of branches or one number for all environments.
template <class K>
struct LinkConstants {
  K rotation[9];  // parent link frame <- this link's frame at q = 0
  K position[3];  // of the joint in the parent link's frame [m]
  LinkInertia<K> inertial;
};

}  // namespace stickslip::dynamics

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Lanes of one robot's bundle kernels: four branches side by side for a plain scalar; a pack keeps
/// its environments.
template <class S>
struct BundleScalar {
  using Wide = S;
  using Constant = Value<S>;
  static constexpr int kLanes = 1;
};
template <>
struct BundleScalar<double> {
  using Wide = Pack<double, kMaxLanes>;
  using Constant = Wide;
  static constexpr int kLanes = kMaxLanes;
};
template <>
struct BundleScalar<float> {
  using Wide = Pack<float, kMaxLanes>;
  using Constant = Wide;
  static constexpr int kLanes = kMaxLanes;
};
template <class S>
using Wide = typename BundleScalar<S>::Wide;
template <class S>
using WideConstant = typename BundleScalar<S>::Constant;

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
