// What the passes over the tree compute at one link: each formula of docs/theory/dynamics.md once,
// for every pass that needs it. What a chain hands from link to link stays in registers.
#pragma once
#include "dynamics/tree.h"
#include "lane/math.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// r times the rotation of a joint at q = 0, which often only renames axes.
template <class W, class K>
STICKSLIP_INLINE Mat3<W> joint_rotation(const Mat3<W>& r, const K constant[9], int renaming) {
  const W* m = r.m;
  if (renaming == 0) return r;
  if (renaming == 1) return {{m[1], m[2], m[0], m[4], m[5], m[3], m[7], m[8], m[6]}};
  if (renaming == 2) return {{m[2], m[0], m[1], m[5], m[3], m[4], m[8], m[6], m[7]}};
  return r * wide_mat3<W>(constant);
}

/// (D3): the pose of the parent becomes that of the link. Returns the joint's motion s (D4).
template <class W, class K>
STICKSLIP_INLINE Spatial<W> move_to_link(const LinkConstants<K>& c, const Slot& slot, W q,
                                         Mat3<W>& r, Vec3<W>& p) {
  p = madd(r, wide3<W>(c.position), p);
  r = joint_rotation(r, c.rotation, slot.renaming);
  const Vec3<W> axis{r.m[2], r.m[5], r.m[8]};
  if (slot.prismatic) {
    p = madd(axis, q, p);
    return {zero3<W>(), axis};
  }
  W sine, cosine;
  sincos(q, sine, cosine);
  // The link frame is turned so that the axis is z.
  const Vec3<W> x{r.m[0], r.m[3], r.m[6]}, y{r.m[1], r.m[4], r.m[7]};
  const Vec3<W> x_turned = madd(y, sine, x * cosine), y_turned = nmadd(x, sine, y * cosine);
  r = {{x_turned.x, y_turned.x, axis.x, x_turned.y, y_turned.y, axis.y, x_turned.z, y_turned.z,
        axis.z}};
  return {axis, cross(p, axis)};
}

/// (D5) at the pose of the link, from constants of the model or of each environment.
template <class W, class K>
STICKSLIP_INLINE void place_inertia(const LinkInertia<K>& c, const Mat3<W>& r, const Vec3<W>& p,
                                    LinkState<W>& link) {
  link.inertia.mass = W(c.mass);
  store(madd(r, wide3<W>(c.com), p), link.inertia.com);
  store(rotate(r, sym3(c.inertia)), link.inertia.rot);
}

/// (D6): velocity and acceleration of the parent become those of the link. Returns minus the
/// inertial force.
template <class W>
STICKSLIP_INLINE Spatial<W> bias_of_link(const LinkState<W>& link, W rate, Spatial<W>& v,
                                         Spatial<W>& a) {
  const Spatial<W> joint = link.axis * rate, parent = v;
  v = v + joint;
  a.ang = cross(v.ang, joint.ang, a.ang);
  a.lin = cross(v.ang + parent.ang, joint.lin, a.lin);
  return -inertial_force(link.inertia, v.ang, a);
}

/// A wrench at the center of mass of a body as a force at the base origin.
template <class W>
STICKSLIP_INLINE Spatial<W> force_of_wrench(const Spatial<W>& wrench, const BodyInertia<W>& body) {
  return {cross(body.com, wrench.lin, wrench.ang), wrench.lin};
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
