// Outward passes: positions, inertias and velocities of all links [Featherstone 2008, ch. 4, 5],
// docs/theory/dynamics.md (D2)-(D5).
#pragma once
#include "dynamics/tree.h"
#include "lane/math.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Rotations, positions and joint axes of all links from the base quaternion (w x y z) and the
/// joints (num_joints).
template <class S>
void compute_positions(Tree<S>& t, const S quaternion[4], const S* joints) {
  using W = Wide<S>;
  t.base.rotation = rotation(quaternion);
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Mat3<W> r = from_parents<S, Mat3>(t, b, t.base.rotation, &LinkState<W>::rotation);
    Vec3<W> p = from_parents<S, Vec3>(t, b, zero3<S>(), &LinkState<W>::position);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
      const auto& c = t.constants[slot];
      LinkState<W>& link = t.links[slot];
      const W q = load_lanes(joints, t.slots[slot].joint);
      p = madd(r, wide3<W>(c.position), p);
      r = r * wide_mat3<W>(c.rotation);
      const Vec3<W> axis{r.m[2], r.m[5], r.m[8]};
      if (t.slots[slot].prismatic) {
        p = madd(axis, q, p);
        link.axis = {zero3<W>(), axis};
      } else {
        W sine, cosine;
        sincos(q, sine, cosine);
        for (int i = 0; i < 9; i += 3) {  // the link frame is turned so that the axis is z
          const W x = r.m[i], y = r.m[i + 1];
          r.m[i] = madd(y, sine, x * cosine);
          r.m[i + 1] = nmadd(x, sine, y * cosine);
        }
        link.axis = {axis, cross(p, axis)};
      }
      link.rotation = r;
      link.position = p;
    }
  }
}

/// Link inertias about the base origin, in world axes, and their sum.
template <class S>
void compute_inertias(Tree<S>& t) {
  using W = Wide<S>;
  t.base.inertia = inertia_at_reference(
      t.base_mass, t.base.rotation * Vec3<S>{t.base_com[0], t.base_com[1], t.base_com[2]},
      rotate(t.base.rotation, wide_sym3<S>(t.base_inertia)));
  t.base.composite = t.base.inertia;
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    RigidInertia<W> sum;
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
      const auto& c = t.constants[slot];
      LinkState<W>& link = t.links[slot];
      const Vec3<W> com = madd(link.rotation, wide3<W>(c.com), link.position);
      link.inertia =
          inertia_at_reference(W(c.mass), com, rotate(link.rotation, wide_sym3<W>(c.inertia)));
      sum = slot == b.first_slot ? link.inertia : sum + link.inertia;
    }
    auto* total = reinterpret_cast<S*>(&t.base.composite);
    const auto* part = reinterpret_cast<const W*>(&sum);
    for (int k = 0; k < kNumbersIn<S, RigidInertia>; ++k)
      for (int lane = 0; lane < b.lanes; ++lane) total[k] = total[k] + lane_of<S>(part[k], lane);
  }
}

/// Link velocities relative to the translation of the base origin.
template <class S>
void compute_velocities(Tree<S>& t, const Vec3<S>& angular_velocity, const S* rates) {
  using W = Wide<S>;
  t.base.velocity = {angular_velocity, zero3<S>()};
  for (int ib = 0; ib < t.num_bundles; ++ib) {
    const Bundle& b = t.bundles[ib];
    Spatial<W> v = from_parents<S, Spatial>(t, b, t.base.velocity, &LinkState<W>::velocity);
    for (int slot = b.first_slot; slot < b.first_slot + b.length; ++slot) {
      LinkState<W>& link = t.links[slot];
      v = madd(link.axis, load_lanes(rates, t.slots[slot].joint), v);
      link.velocity = v;
    }
  }
}

/// A point of a body in world axes, relative to the base origin; `local` is in the turned link
/// frame.
template <class S>
STICKSLIP_INLINE Vec3<S> point_position(const Tree<S>& t, LinkIndex link, const Vec3<S>& local) {
  if (link.slot == kBaseSlot) return t.base.rotation * local;
  return madd(field_of<S, Mat3>(t, link, &LinkState<Wide<S>>::rotation), local,
              field_of<S, Vec3>(t, link, &LinkState<Wide<S>>::position));
}

/// Velocity of the point of a link that is at `point` (relative to the base origin), without the
/// base's translation.
template <class S>
STICKSLIP_INLINE Vec3<S> point_velocity(const Tree<S>& t, LinkIndex link, const Vec3<S>& point) {
  const Spatial<S> v = link.slot == kBaseSlot
                           ? t.base.velocity
                           : field_of<S, Spatial>(t, link, &LinkState<Wide<S>>::velocity);
  return cross(v.ang, point, v.lin);
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
