// Outward passes: positions, inertias and velocities of all links [Featherstone 2008, ch. 4, 5],
// docs/theory/dynamics.md (D2)-(D5).
#pragma once
#include "dynamics/walk.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Rotations, positions and joint axes of all links from the base quaternion (w x y z) and the
/// joints (num_joints).
template <class S>
void compute_positions(Tree<S>& t, const S quaternion[4], const S* joints) {
  WalkInput<S> in;
  in.quaternion = quaternion, in.joints = joints;
  walk<kPositions>(t, in);
}

/// Link inertias about the base origin, in world axes, and their sum.
template <class S>
void compute_inertias(Tree<S>& t) {
  walk<kInertias | kComposite>(t, WalkInput<S>{});
}

/// Link velocities relative to the translation of the base origin.
template <class S>
void compute_velocities(Tree<S>& t, const Vec3<S>& angular_velocity, const S* rates) {
  WalkInput<S> in;
  in.angular_velocity = angular_velocity, in.rates = rates;
  walk<kVelocities>(t, in);
}

/// Rotation of a link's turned frame to world axes.
template <class S>
STICKSLIP_INLINE Mat3<S> link_rotation(const Tree<S>& t, LinkIndex link) {
  if (link.slot == kBaseSlot) return t.base.rotation;
  return field_of<S, Mat3>(t, link, &LinkState<Wide<S>>::rotation);
}
/// Heights of the tips of that frame's axes.
template <class S>
STICKSLIP_INLINE Vec3<S> heights_of_axes(const Tree<S>& t, LinkIndex link) {
  const Mat3<S> r = link_rotation(t, link);
  return {r.m[6], r.m[7], r.m[8]};
}

/// A point of a body in world axes, relative to the base origin; `local` is in the turned link
/// frame.
template <class S>
STICKSLIP_INLINE Vec3<S> point_position(const Tree<S>& t, LinkIndex link, const Vec3<S>& local) {
  if (link.slot == kBaseSlot) return t.base.rotation * local;
  return madd(link_rotation(t, link), local,
              field_of<S, Vec3>(t, link, &LinkState<Wide<S>>::position));
}

/// The height of the same point above the base origin: z of point_position, to the bit.
template <class S>
STICKSLIP_INLINE S point_height(const Tree<S>& t, LinkIndex link, const Vec3<S>& local) {
  const Vec3<S> up = heights_of_axes(t, link);
  if (link.slot == kBaseSlot) return dot(up, local);
  return dot(up, local, field_of<S, Vec3>(t, link, &LinkState<Wide<S>>::position).z);
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
