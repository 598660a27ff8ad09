// One walk over the tree that does any of the passes, so that passes that follow each other share
// the loads: outward from the base (positions, inertias, velocities, bias force, L u, L^-1 x), then
// inward from the tips (factor, L^-T f). A part computes the same bits in whatever walk it takes
// part.
#pragma once
#include "dynamics/base.h"
#include "dynamics/block.h"
#include "dynamics/link.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// What a walk does.
enum Part : unsigned {
  kPositions = 1,          // rotations, positions and joint axes
  kInertias = 2,           // of the links about the base origin
  kComposite = 4,          // and of the whole robot, joints locked
  kVelocities = 8,         // of the links, relative to the base's translation
  kBias = 16,              // links[].force = minus inertial and gravity load, and velocities
  kMultiply = 32,          // x = L u
  kFactor = 64,            // M + diag(diagonal) = L^T L
  kSolveTransposed = 128,  // x = L^-T (tau + forces on base and links)
  kWrenches = 256,         // adds wrenches to the forces on base and links
  kLean = 512,             // keeps poses and velocities of links that carry something only
};

/// What a walk reads besides the tree; what none of its parts needs may stay unset.
template <class S>
struct WalkInput {
  const S* quaternion;                     // w x y z
  const S* joints;                         // (num_joints)
  Vec3<S> angular_velocity;                // of the base
  Vec3<S> linear_velocity;                 // of the base; only x = L u depends on it
  const S* rates;                          // (num_joints)
  Vec3<S> gravity;                         // [m/s^2]
  const S* diagonal = nullptr;             // (num_joints); null: zero
  const S* tau = nullptr;                  // (num_joints); null: zero
  const Spatial<S>* base_force = nullptr;  // on body 0, besides its bias force
  // At the centers of mass, world axes: of body 0 and per slot; both or none.
  const Spatial<S>* base_wrench = nullptr;
  const Spatial<Wide<S>>* wrenches = nullptr;
  double scale = 1;  // of x, x = L^-T (scale forces)
};

template <unsigned kParts, class S>
STICKSLIP_INLINE void start_base(Tree<S>& t, const WalkInput<S>& in) {
  BaseState<S>& base = t.base;
  if constexpr (kParts & kPositions) base.rotation = rotation(in.quaternion);
  if constexpr (kParts & kInertias) {
    base.inertia = {t.base_mass,
                    base.rotation * Vec3<S>{t.base_com[0], t.base_com[1], t.base_com[2]},
                    rotate(base.rotation, sym3(t.base_inertia))};
    if constexpr (kParts & kComposite) base.composite = at_reference(base.inertia);
  }
  if constexpr (kParts & (kVelocities | kBias)) base.velocity = {in.angular_velocity, zero3<S>()};
  if constexpr (kParts & kBias) {
    base.acceleration = {zero3<S>(), -in.gravity};
    base.force = -inertial_force(base.inertia, in.angular_velocity, base.acceleration);
  }
  if constexpr (kParts & kBias)
    if (in.base_force) base.force = base.force + *in.base_force;
  if constexpr (kParts & kWrenches)
    if (in.base_wrench) base.force = base.force + force_of_wrench(*in.base_wrench, base.inertia);
}

// ---- one chain of every bundle lane: outward

/// Whether a walk stores pose and velocity of the links of a slot. A world's are few, and asked
/// for.
template <unsigned kParts, class S>
STICKSLIP_INLINE bool keeps(const Slot& slot) {
  return !(kParts & kLean) || Tree<S>::kLanes > 1 || slot.carries;
}

/// The inertia of a slot's links at their pose.
template <class S>
STICKSLIP_INLINE void place_inertia(Tree<S>& t, int slot, const Mat3<Wide<S>>& r,
                                    const Vec3<Wide<S>>& p) {
  if (t.inertias)
    place_inertia(t.inertias[slot], r, p, t.links[slot]);
  else
    place_inertia(t.constants[slot].inertial, r, p, t.links[slot]);
}

/// With inertias in one pass, so that the pose stays in registers. In packs of environments memory
/// traffic counts: the links of one step do not fit into the first-level cache.
template <unsigned kParts, class S>
void chain_positions(Tree<S>& t, const Bundle& b, const S* joints) {
  using W = Wide<S>;
  Mat3<W> r = from_parents<S, Mat3>(t, b, t.base.rotation, &LinkState<W>::rotation);
  Vec3<W> p = from_parents<S, Vec3>(t, b, zero3<S>(), &LinkState<W>::position);
  for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
    LinkState<W>& link = t.links[slot];
    const Slot& s = t.slots[slot];
    store(move_to_link(t.constants[slot], s, load_lanes(joints, s.joint), r, p), link.axis);
    if (keeps<kParts, S>(s)) {
      store(r, link.rotation);
      store(p, link.position);
    }
    if constexpr (kParts & kInertias) place_inertia(t, slot, r, p);
  }
}

template <class S>
void chain_inertias(Tree<S>& t, const Bundle& b) {
  for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot)
    place_inertia(t, slot, t.links[slot].rotation, t.links[slot].position);
}

template <class S>
void add_composite(Tree<S>& t, const Bundle& b) {
  RigidInertia<Wide<S>> sum = at_reference(t.links[b.first_slot].inertia);
  for (int slot = b.first_slot + 1; slot < b.first_slot + b.length; ++slot)
    sum = sum + at_reference(t.links[slot].inertia);
  add_lanes<S, RigidInertia>(sum, b, t.base.composite);
}

template <class S>
void chain_velocities(Tree<S>& t, const Bundle& b, const S* rates) {
  using W = Wide<S>;
  Spatial<W> v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
  for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
    v = madd(t.links[slot].axis, load_lanes(rates, t.slots[slot].joint), v);
    store(v, t.links[slot].velocity);
  }
}

template <unsigned kParts, class S>
void chain_bias(Tree<S>& t, const Bundle& b, const S* rates) {
  using W = Wide<S>;
  Spatial<W> v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
  Spatial<W> a = from_parents<S, Spatial>(t, b, t.base.acceleration, &LinkState<W>::acceleration);
  const int last = b.first_slot + b.length - 1;
  for (int slot = b.first_slot; slot <= last; ++slot) {
    LinkState<W>& link = t.links[slot];
    store(bias_of_link(link, load_lanes(rates, t.slots[slot].joint), v, a), link.force);
    if (keeps<kParts, S>(t.slots[slot])) store(v, link.velocity);
    if (slot == last && b.has_children) store(a, link.acceleration);
  }
}

template <class S>
void chain_multiply(Tree<S>& t, const Bundle& b, const Vec3<S>& translation, const S* rates) {
  using W = Wide<S>;
  Spatial<W> v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
  blocks_outward(b, [&](int slot, auto n) STICKSLIP_LAMBDA {
    constexpr int N = decltype(n)::value;
    v.lin = v.lin + wide<W>(translation);
    multiply_block<N>(t, slot, rates, v);
    v = t.links[slot + N - 1].velocity;
  });
}

// ---- inward

template <class S>
void chain_factor(Tree<S>& t, const Bundle& b, const S* diagonal) {
  using W = Wide<S>;
  ArticulatedInertia<W> rest;
  int slot = b.first_slot + b.length;
  next_block_inward(b, slot, [&](int first, auto n) STICKSLIP_LAMBDA {
    constexpr int N = decltype(n)::value;
    const LinkState<W>& last = t.links[first + N - 1];
    if (b.has_children)
      rest = factor_block<N>(t, first, last.from_children + at_reference(last.inertia), diagonal);
    else
      rest = factor_block<N>(t, first, at_reference(last.inertia), diagonal);
  });
  while (slot > b.first_slot)
    next_block_inward(b, slot, [&](int first, auto n) STICKSLIP_LAMBDA {
      constexpr int N = decltype(n)::value;
      rest =
          factor_block<N>(t, first, rest + at_reference(t.links[first + N - 1].inertia), diagonal);
    });
  add_to_parents<S, ArticulatedInertia>(t, b, rest, t.base.articulated,
                                        &LinkState<W>::from_children);
}

template <class S>
void chain_solve_transposed(Tree<S>& t, const Bundle& b, const S* tau, double scale,
                            Spatial<S>& on_base) {
  using W = Wide<S>;
  Spatial<W> f = zero_spatial<W>();
  if (b.has_children) f = t.links[b.first_slot + b.length - 1].force_from_children;
  for (int slot = b.first_slot + b.length; slot > b.first_slot;)
    next_block_inward(b, slot, [&](int first, auto n) STICKSLIP_LAMBDA {
      solve_transposed_block<decltype(n)::value>(t, first, tau, constant<W>(scale), f);
    });
  add_to_parents<S, Spatial>(t, b, f, on_base, &LinkState<W>::force_from_children);
}

// ---- all of them

template <unsigned kParts, class S>
STICKSLIP_INLINE void walk_outward(Tree<S>& t, const Bundle& b, const WalkInput<S>& in) {
  if constexpr (kParts & kPositions)
    chain_positions<kParts&(kInertias | kLean)>(t, b, in.joints);
  else if constexpr (kParts & kInertias)
    chain_inertias(t, b);
  if constexpr (kParts & kComposite) add_composite(t, b);
  if constexpr (kParts & kBias)
    chain_bias<kParts & kLean>(t, b, in.rates);
  else if constexpr (kParts & kVelocities)
    chain_velocities(t, b, in.rates);
  if constexpr (kParts & kWrenches)
    if (in.wrenches)
      for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot)
        t.links[slot].force =
            t.links[slot].force + force_of_wrench(in.wrenches[slot], t.links[slot].inertia);
  if constexpr (kParts & kMultiply) chain_multiply(t, b, in.linear_velocity, in.rates);
}

template <unsigned kParts, class S>
STICKSLIP_INLINE void walk_inward(Tree<S>& t, const Bundle& b, const WalkInput<S>& in,
                                  Spatial<S>& on_base) {
  if constexpr (kParts & kFactor) chain_factor(t, b, in.diagonal);
  if constexpr (kParts & kSolveTransposed) chain_solve_transposed(t, b, in.tau, in.scale, on_base);
}

/// The sums over the chains that hang on a link start at zero.
template <unsigned kParts, class S>
STICKSLIP_INLINE void clear_sums(Tree<S>& t) {
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    if (!t.bundles[ib].has_children) continue;
    LinkState<Wide<S>>& end = t.links[t.bundles[ib].first_slot + t.bundles[ib].length - 1];
    if constexpr (kParts & kFactor) end.from_children = {};
    if constexpr (kParts & kSolveTransposed) end.force_from_children = {};
  }
}

/// Does the parts `kParts` in one walk. A bundle that nothing hangs on goes out and in at once,
/// while its links are in the cache.
template <unsigned kParts, class S>
void walk(Tree<S>& t, const WalkInput<S>& in) {
  constexpr bool kOutward = kParts & (kPositions | kInertias | kVelocities | kBias | kMultiply);
  constexpr bool kInward = kParts & (kFactor | kSolveTransposed);
  // The order of the composite's sum must not depend on which bundles have children.
  constexpr bool kAtOnce = kOutward && kInward && !(kParts & kComposite);
  start_base<kParts>(t, in);
  if constexpr (kOutward)
    for (int ib = 0; ib < t.num_bundles; ++ib)
      if (!kAtOnce || t.bundles[ib].has_children) walk_outward<kParts>(t, t.bundles[ib], in);
  if constexpr (kInward) {
    clear_sums<kParts>(t);
    if constexpr (kParts & kFactor)
      store(articulated(at_reference(t.base.inertia)), t.base.articulated);
    Spatial<S> on_base;
    if constexpr (kParts & kSolveTransposed) on_base = t.base.force;
    for (int ib = t.num_bundles - 1; ib >= 0; --ib) {
      if constexpr (kAtOnce)
        if (!t.bundles[ib].has_children) walk_outward<kParts>(t, t.bundles[ib], in);
      walk_inward<kParts>(t, t.bundles[ib], in, on_base);
    }
    if constexpr (kParts & kFactor)
      if (t.floating) factor_base(t.base);
    if constexpr (kParts & kSolveTransposed) {
      to_rows(on_base * constant<S>(in.scale), t.base.x);
      if (t.floating) solve_base_transposed(t.base, t.base.x);
    }
  } else if constexpr (kParts & kMultiply) {
    if (t.floating) multiply_base(t.base, in.linear_velocity);
  }
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
