// The tree as the kernels work on it: constants of the model, and the workspace one step fills.
#pragma once
#include "dynamics/branches.h"
#include "lane/row3.h"
#include "spatial/numbers.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// What a step knows of the links of one slot; W holds one branch per lane. World axes, base origin
/// as reference.
template <class W>
struct LinkState {
  Mat3<W> rotation;  // turned link frame -> world
  Vec3<W> position;  // of the link frame's origin [m]
  Spatial<W> axis;   // joint motion s: link velocity = parent's + s * rate
  BodyInertia<W> inertia;
  Spatial<W> velocity;      // relative to the translation of the base origin
  Spatial<W> acceleration;  // of the last link of a chain that others hang on
  Spatial<W> force;         // applied to the link
  Spatial<W> arm;    // U = I_A s / sqrt(D): row of the factor L, as a force at the base origin
  W root, inv_root;  // sqrt(D), 1 / sqrt(D), D = s . I_A s: diagonal of L
  W inner[2];        // entries of L to the joints before it in its block: parent, grandparent
  W x;               // coordinate of this joint in L-space, x = L^-T (generalized force)
  ArticulatedInertia<W> from_children;  // sums over the chains that hang on this link
  Spatial<W> force_from_children;
};

/// Body 0. Its six rows come in the order of u: linear, angular.
template <class S>
struct BaseState {
  Mat3<S> rotation;
  BodyInertia<S> inertia;
  Spatial<S> velocity;  // ang = angular velocity, lin = 0: the reference translates with the base
  Spatial<S> acceleration;
  Spatial<S> force;
  RigidInertia<S> composite;  // of the whole tree, joints locked
  ArticulatedInertia<S> articulated;
  S factor[6][6];     // strict lower triangle of L_b, articulated inertia = L_b^T L_b
  S inv_diagonal[6];  // 1 / L_b[i][i]
  S diagonal[6];
  S x[6];  // L-space coordinates
};

template <class S>
struct Tree {
  using W = Wide<S>;
  using K = WideConstant<S>;
  static constexpr int kLanes = BundleScalar<S>::kLanes;

  bool floating;
  int num_bundles, num_slots, num_joints;
  const Bundle* bundles;
  const Slot* slots;
  const LinkConstants<K>* constants;
  LinkState<W>* links;
  const LinkInertia<W>*
      inertias;  // per slot, each environment its own; null: those of the constants
  S base_mass, base_com[3], base_inertia[6];
  BaseState<S> base;
};

// ---- lanes of a bundle in and out of memory

/// Lanes of a bundle that are in use. One, where environments are the lanes: the compiler knows.
template <class S>
STICKSLIP_INLINE int used_lanes(const Bundle& b) {
  if constexpr (BundleScalar<S>::kLanes == 1)
    return 1;
  else
    return b.lanes;
}

/// values[index[lane]] of each lane.
template <class S>
STICKSLIP_INLINE Wide<S> load_lanes(const S* values, const int index[kMaxLanes]) {
  if constexpr (BundleScalar<S>::kLanes == 1)
    return values[index[0]];
  else
    return typename Wide<S>::Vector{values[index[0]], values[index[1]], values[index[2]],
                                    values[index[3]]};
}

template <class S>
STICKSLIP_INLINE void store_lanes(const Wide<S>& w, S* values, const int index[kMaxLanes],
                                  const Bundle& b) {
  if constexpr (BundleScalar<S>::kLanes == 1) {
    values[index[0]] = w;
  } else {
    for (int lane = 0; lane < b.lanes; ++lane) values[index[lane]] = get_lane(w, lane);
  }
}

/// One lane of a wide number in memory.
template <class S>
STICKSLIP_INLINE S lane_of(const Wide<S>& w, int lane) {
  if constexpr (BundleScalar<S>::kLanes == 1)
    return w;
  else
    return get_lane(w, lane);
}

template <class S>
STICKSLIP_INLINE void put_lane(Wide<S>& w, int lane, S value) {
  if constexpr (BundleScalar<S>::kLanes == 1)
    w = value;
  else
    set_lane(w, lane, value);
}

/// A field of one link.
template <class S, template <class> class X>
STICKSLIP_INLINE X<S> field_of(const Tree<S>& t, LinkIndex link,
                               X<Wide<S>> LinkState<Wide<S>>::* field) {
  const auto* from = reinterpret_cast<const Wide<S>*>(&(t.links[link.slot].*field));
  return Numbers<S, X>::make([&](int k)
                                 STICKSLIP_LAMBDA { return lane_of<S>(from[k], link.lane); });
}

/// A field of the parents of a bundle's chains: `base` where they hang on body 0.
template <class S, template <class> class X>
STICKSLIP_INLINE X<Wide<S>> from_parents(const Tree<S>& t, const Bundle& b, const X<S>& base,
                                         X<Wide<S>> LinkState<Wide<S>>::* field) {
  using W = Wide<S>;
  if (b.on_base) {
    const S* from = reinterpret_cast<const S*>(&base);
    return Numbers<W, X>::make([&](int k) STICKSLIP_LAMBDA { return W(from[k]); });
  }
  if constexpr (BundleScalar<S>::kLanes == 1) {
    return t.links[b.parent[0].slot].*field;
  } else {
    const S* from[kMaxLanes];
    for (int lane = 0; lane < kMaxLanes; ++lane)
      from[lane] =
          reinterpret_cast<const S*>(&(t.links[b.parent[lane].slot].*field)) + b.parent[lane].lane;
    return Numbers<W, X>::make([&](int k) STICKSLIP_LAMBDA {
      k *= kMaxLanes;
      return W(typename W::Vector{from[0][k], from[1][k], from[2][k], from[3][k]});
    });
  }
}

/// Adds what each chain of a bundle hands to its parent. Last chain first, as the bundles
/// themselves are visited, so that the order of the sum does not depend on how many chains lie side
/// by side.
template <class S, template <class> class X>
STICKSLIP_INLINE void add_to_parents(Tree<S>& t, const Bundle& b, const X<Wide<S>>& given,
                                     X<S>& base, X<Wide<S>> LinkState<Wide<S>>::* field) {
  using W = Wide<S>;
  if (b.on_base) {
    S* to = reinterpret_cast<S*>(&base);
    Numbers<W, X>::visit(given, [&](int k, const W& x) STICKSLIP_LAMBDA {
      for (int lane = used_lanes<S>(b) - 1; lane >= 0; --lane) to[k] = to[k] + lane_of<S>(x, lane);
    });
  } else {
    for (int lane = used_lanes<S>(b) - 1; lane >= 0; --lane) {
      auto* to = reinterpret_cast<W*>(&(t.links[b.parent[lane].slot].*field));
      Numbers<W, X>::visit(given, [&](int k, const W& x) STICKSLIP_LAMBDA {
        if constexpr (BundleScalar<S>::kLanes == 1)
          to[k] = to[k] + x;
        else
          set_lane(to[k], b.parent[lane].lane,
                   get_lane(to[k], b.parent[lane].lane) + get_lane(x, lane));
      });
    }
  }
}

/// Adds the lanes of a bundle to `sum`, one by one.
template <class S>
STICKSLIP_INLINE S add_lanes(const Wide<S>& part, const Bundle& b, S sum) {
  for (int lane = 0; lane < used_lanes<S>(b); ++lane) sum = sum + lane_of<S>(part, lane);
  return sum;
}
template <class S, template <class> class X>
STICKSLIP_INLINE void add_lanes(const X<Wide<S>>& part, const Bundle& b, X<S>& total) {
  S* to = reinterpret_cast<S*>(&total);
  Numbers<Wide<S>, X>::visit(
      part, [&](int k, const Wide<S>& x) STICKSLIP_LAMBDA { to[k] = add_lanes<S>(x, b, to[k]); });
}

template <class W, class S>
STICKSLIP_INLINE Vec3<W> wide(const Vec3<S>& v) {
  return {W(v.x), W(v.y), W(v.z)};
}
template <class W, class K>
STICKSLIP_INLINE Vec3<W> wide3(const K v[3]) {
  return {W(v[0]), W(v[1]), W(v[2])};
}
template <class K>
STICKSLIP_INLINE Sym3<K> sym3(const K v[6]) {
  return {v[0], v[1], v[2], v[3], v[4], v[5]};
}
template <class W, class K>
STICKSLIP_INLINE Mat3<W> wide_mat3(const K v[9]) {
  return {{W(v[0]), W(v[1]), W(v[2]), W(v[3]), W(v[4]), W(v[5]), W(v[6]), W(v[7]), W(v[8])}};
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
