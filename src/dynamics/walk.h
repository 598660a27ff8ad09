// One walk over the tree that does any of the passes, so that passes that follow each other share
// the loads: outward from the base (positions, inertias, velocities, bias force, L u, L^-1 x), then
// inward from the tips (factor, L^-T f). A part computes the same bits in whatever walk it takes
// part.
#pragma once
#include "dynamics/base.h"
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
  kSolveTransposed = 128,  // x = L^-T (tau + force on the base)
  kLinkForces = 256,       // and the forces on the links take part
};

/// What a walk reads besides the tree; what none of its parts needs may stay unset.
template <class S>
struct WalkInput {
  const S* quaternion;           // w x y z
  const S* joints;               // (num_joints)
  Vec3<S> angular_velocity;      // of the base
  Vec3<S> linear_velocity;       // of the base; only x = L u depends on it
  const S* rates;                // (num_joints)
  Vec3<S> gravity;               // [m/s^2]
  const S* diagonal;             // (num_joints) or null
  const S* tau;                  // (num_joints) or null
  const Spatial<S>* base_force;  // on body 0, besides its bias force; or null
};

template <unsigned kParts, class S>
STICKSLIP_INLINE void start_base(Tree<S>& t, const WalkInput<S>& in) {
  BaseState<S>& base = t.base;
  if constexpr (kParts & kPositions) base.rotation = rotation(in.quaternion);
  if constexpr (kParts & kInertias) {
    base.inertia = inertia_at_reference(
        t.base_mass, base.rotation * Vec3<S>{t.base_com[0], t.base_com[1], t.base_com[2]},
        rotate(base.rotation, wide_sym3<S>(t.base_inertia)));
    if constexpr (kParts & kComposite) base.composite = base.inertia;
  }
  if constexpr (kParts & (kVelocities | kBias)) base.velocity = {in.angular_velocity, zero3<S>()};
  if constexpr (kParts & kBias) {
    base.acceleration = {zero3<S>(), -in.gravity};
    base.force =
        -cross_force(base.velocity, base.inertia * base.velocity, base.inertia * base.acceleration);
  }
}

template <unsigned kParts, class S>
STICKSLIP_INLINE void walk_outward(Tree<S>& t, const Bundle& b, const WalkInput<S>& in) {
  using W = Wide<S>;
  Mat3<W> r;
  Vec3<W> p;
  Spatial<W> v, a;
  RigidInertia<W> sum;
  if constexpr (kParts & kPositions) {
    r = from_parents<S, Mat3>(t, b, t.base.rotation, &LinkState<W>::rotation);
    p = from_parents<S, Vec3>(t, b, zero3<S>(), &LinkState<W>::position);
  }
  if constexpr (kParts & (kVelocities | kBias | kMultiply))
    v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
  if constexpr (kParts & kBias)
    a = from_parents<S, Spatial>(t, b, t.base.acceleration, &LinkState<W>::acceleration);
  const int last = b.first_slot + b.length - 1;
  for (int slot = b.first_slot; slot <= last; ++slot) {
    LinkState<W>& link = t.links[slot];
    const LinkConstants<typename Tree<S>::K>& c = t.constants[slot];
    Spatial<W> axis;
    RigidInertia<W> inertia;
    if constexpr (kParts & kPositions) {
      axis = move_to_link(c, t.slots[slot].prismatic, load_lanes(in.joints, t.slots[slot].joint), r,
                          p);
      link.axis = axis, link.rotation = r, link.position = p;
    } else if constexpr (kParts & (kVelocities | kBias)) {
      axis = link.axis;
    }
    if constexpr (kParts & kInertias) {
      if constexpr (!(kParts & kPositions)) r = link.rotation, p = link.position;
      inertia = t.inertias ? inertia_at(t.inertias[slot], r, p) : inertia_at(c.inertial, r, p);
      link.inertia = inertia;
      if constexpr (kParts & kComposite) sum = slot == b.first_slot ? inertia : sum + inertia;
    } else if constexpr (kParts & kBias) {
      inertia = link.inertia;
    }
    W rate;
    if constexpr (kParts & (kVelocities | kBias | kMultiply))
      rate = load_lanes(in.rates, t.slots[slot].joint);
    if constexpr (kParts & kMultiply)
      link.x = multiply_at_link(link, v, wide<W>(in.linear_velocity), rate);
    if constexpr (kParts & kBias) {
      link.force = bias_of_link(inertia, axis, rate, v, a);
      link.velocity = v;
    } else if constexpr (kParts & kVelocities) {
      v = madd(axis, rate, v);
      link.velocity = v;
    } else if constexpr (kParts & kMultiply) {
      v = link.velocity;
    }
  }
  if constexpr (kParts & kBias)
    if (b.has_children) t.links[last].acceleration = a;
  if constexpr (kParts & kComposite) add_lanes<S, RigidInertia>(sum, b.lanes, t.base.composite);
}

template <unsigned kParts, class S>
STICKSLIP_INLINE void walk_inward(Tree<S>& t, const Bundle& b, const WalkInput<S>& in,
                                  Spatial<S>& on_base) {
  using W = Wide<S>;
  ArticulatedInertia<W> rest;
  Spatial<W> f = zero_spatial<W>();
  const int last = b.first_slot + b.length - 1;
  for (int slot = last; slot >= b.first_slot; --slot) {
    LinkState<W>& link = t.links[slot];
    const Spatial<W> axis = link.axis;
    if constexpr (kParts & kFactor) {
      W extra;
      if (in.diagonal) extra = load_lanes(in.diagonal, t.slots[slot].joint);
      ArticulatedInertia<W> i = slot == last ? articulated(link.inertia) : rest + link.inertia;
      if (slot == last && b.has_children) i = i + link.from_children;
      rest = factor_at_link(i, axis, in.diagonal ? &extra : nullptr, link);
    }
    if constexpr (kParts & kSolveTransposed) {
      if constexpr (kParts & kLinkForces) f = f + link.force;
      if (slot == last && b.has_children) f = f + link.force_from_children;
      W tau;
      if (in.tau) tau = load_lanes(in.tau, t.slots[slot].joint);
      f = solve_at_link(f, axis, in.tau ? &tau : nullptr, link);
    }
  }
  if constexpr (kParts & kFactor)
    add_to_parents<S, ArticulatedInertia>(t, b, rest, t.base.articulated,
                                          &LinkState<W>::from_children);
  if constexpr (kParts & kSolveTransposed)
    add_to_parents<S, Spatial>(t, b, f, on_base, &LinkState<W>::force_from_children);
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
    if constexpr (kParts & kFactor) t.base.articulated = articulated(t.base.inertia);
    Spatial<S> on_base;
    if constexpr (kParts & kSolveTransposed) {
      if constexpr (kParts & kLinkForces)
        on_base = in.base_force ? t.base.force + *in.base_force : t.base.force;
      else
        on_base = in.base_force ? *in.base_force : zero_spatial<S>();
    }
    for (int ib = t.num_bundles - 1; ib >= 0; --ib) {
      if constexpr (kAtOnce)
        if (!t.bundles[ib].has_children) walk_outward<kParts>(t, t.bundles[ib], in);
      walk_inward<kParts>(t, t.bundles[ib], in, on_base);
    }
    if constexpr (kParts & kFactor)
      if (t.floating) factor_base(t.base);
    if constexpr (kParts & kSolveTransposed) {
      to_rows(on_base, t.base.x);
      if (t.floating) solve_base_transposed(t.base, t.base.x);
    }
  } else if constexpr (kParts & kMultiply) {
    if (t.floating) multiply_base(t.base, in.linear_velocity);
  }
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
