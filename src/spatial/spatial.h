// Spatial vectors and inertias, all in world axes with the base origin as reference point
// [Featherstone 2008, ch. 2].
//
// One reference point for the whole tree: velocities, forces and inertias of different links add
// without transforms.
#pragma once
#include "spatial/vec3.h"

namespace stickslip::inline STICKSLIP_KERNELS {

/// A motion (angular velocity; velocity of the point at the reference) or a force (moment about the
/// reference; force).
template <class S>
struct Spatial {
  Vec3<S> ang, lin;
};

template <class S>
STICKSLIP_INLINE Spatial<S> zero_spatial() {
  return {zero3<S>(), zero3<S>()};
}
template <class S>
STICKSLIP_INLINE Spatial<S> operator+(const Spatial<S>& a, const Spatial<S>& b) {
  return {a.ang + b.ang, a.lin + b.lin};
}
template <class S>
STICKSLIP_INLINE Spatial<S> operator-(const Spatial<S>& a, const Spatial<S>& b) {
  return {a.ang - b.ang, a.lin - b.lin};
}
template <class S>
STICKSLIP_INLINE Spatial<S> operator-(const Spatial<S>& a) {
  return {-a.ang, -a.lin};
}
template <class S>
STICKSLIP_INLINE Spatial<S> operator*(const Spatial<S>& a, S k) {
  return {a.ang * k, a.lin * k};
}
/// a * k + c
template <class S>
STICKSLIP_INLINE Spatial<S> madd(const Spatial<S>& a, S k, const Spatial<S>& c) {
  return {madd(a.ang, k, c.ang), madd(a.lin, k, c.lin)};
}
/// c - a * k
template <class S>
STICKSLIP_INLINE Spatial<S> nmadd(const Spatial<S>& a, S k, const Spatial<S>& c) {
  return {nmadd(a.ang, k, c.ang), nmadd(a.lin, k, c.lin)};
}
/// Power of a force on a motion.
template <class S>
STICKSLIP_INLINE S dot(const Spatial<S>& a, const Spatial<S>& b) {
  return dot(a.ang, b.ang) + dot(a.lin, b.lin);  // two short chains instead of a long one
}
/// Mass, first moment h = m c and rotational inertia about the reference point.
template <class S>
struct RigidInertia {
  S mass;
  Vec3<S> h;
  Sym3<S> rot;
};

template <class S>
STICKSLIP_INLINE RigidInertia<S> operator+(const RigidInertia<S>& a, const RigidInertia<S>& b) {
  return {a.mass + b.mass, a.h + b.h, a.rot + b.rot};
}
/// Mass, center of mass c and rotational inertia about it.
template <class S>
struct BodyInertia {
  S mass;
  Vec3<S> com;
  Sym3<S> rot;
};

/// The same body seen from the reference point.
template <class S>
STICKSLIP_INLINE RigidInertia<S> at_reference(const BodyInertia<S>& i) {
  const Vec3<S>& c = i.com;
  const S hx = c.x * i.mass, hy = c.y * i.mass, hz = c.z * i.mass;
  const S xx = hx * c.x, yy = hy * c.y, zz = hz * c.z;
  return {i.mass,
          {hx, hy, hz},
          {i.rot.xx + (yy + zz), nmadd(hx, c.y, i.rot.xy), nmadd(hx, c.z, i.rot.xz),
           i.rot.yy + (xx + zz), nmadd(hy, c.z, i.rot.yz), i.rot.zz + (xx + yy)}};
}
/// Force that gives a body with angular velocity w the angular acceleration a.ang, and its point at
/// the reference the acceleration a.lin. Velocities enter only through w w^T, which center and
/// moment share. The moment uses the force as it was rounded, so that the error of a large
/// centripetal force has no lever to a joint through the center of mass.
template <class S>
STICKSLIP_INLINE Spatial<S> inertial_force(const BodyInertia<S>& i, const Vec3<S>& w,
                                           const Spatial<S>& a) {
  const Vec3<S>& e = a.ang;
  const Sym3<S>& j = i.rot;
  const S xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z;
  const S xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
  // Acceleration of a point r: a.lin + A r, A = [e]x + w w^T - |w|^2 1.
  const Mat3<S> m{{-(yy + zz), xy - e.z, xz + e.y, xy + e.z, -(xx + zz), yz - e.x, xz - e.y,
                   yz + e.x, -(xx + yy)}};
  // J e + w x J w
  const Vec3<S> moment{
      nmadd(j.xy, m.m[6],
            madd(j.xz, m.m[3], madd(j.yz, yy - zz, madd(j.zz - j.yy, yz, j.xx * e.x)))),
      nmadd(j.yz, m.m[1],
            madd(j.xy, m.m[7], madd(j.xz, zz - xx, madd(j.xx - j.zz, xz, j.yy * e.y)))),
      nmadd(j.xz, m.m[5],
            madd(j.yz, m.m[2], madd(j.xy, xx - yy, madd(j.yy - j.xx, xy, j.zz * e.z))))};
  const Vec3<S> f = madd(m, i.com, a.lin) * i.mass;
  return {cross(i.com, f, moment), f};
}

/// Articulated-body inertia: (moment; force) = [aa al; al^T ll] (angular; linear) [Featherstone
/// 2008, sec. 7.1].
template <class S>
struct ArticulatedInertia {
  Sym3<S> aa;
  Mat3<S> al;
  Sym3<S> ll;
};

template <class S>
STICKSLIP_INLINE ArticulatedInertia<S> articulated(const RigidInertia<S>& a) {
  const S o = constant<S>(0);
  return {a.rot,
          {{o, -a.h.z, a.h.y, a.h.z, o, -a.h.x, -a.h.y, a.h.x, o}},
          {a.mass, o, o, a.mass, o, a.mass}};
}
template <class S>
STICKSLIP_INLINE ArticulatedInertia<S> operator+(const ArticulatedInertia<S>& a,
                                                 const RigidInertia<S>& b) {
  ArticulatedInertia<S> r = a;
  r.aa = r.aa + b.rot;
  r.al.m[1] = r.al.m[1] - b.h.z, r.al.m[2] += b.h.y;
  r.al.m[3] += b.h.z, r.al.m[5] = r.al.m[5] - b.h.x;
  r.al.m[6] = r.al.m[6] - b.h.y, r.al.m[7] += b.h.x;
  r.ll.xx += b.mass, r.ll.yy += b.mass, r.ll.zz += b.mass;
  return r;
}
template <class S>
STICKSLIP_INLINE ArticulatedInertia<S> operator+(const ArticulatedInertia<S>& a,
                                                 const ArticulatedInertia<S>& b) {
  const S *x = a.al.m, *y = b.al.m;  // written out, so that the values stay in registers
  return {a.aa + b.aa,
          {{x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3], x[4] + y[4], x[5] + y[5],
            x[6] + y[6], x[7] + y[7], x[8] + y[8]}},
          a.ll + b.ll};
}
template <class S>
STICKSLIP_INLINE const ArticulatedInertia<S>& articulated(const ArticulatedInertia<S>& a) {
  return a;
}
template <class S>
STICKSLIP_INLINE Spatial<S> operator*(const ArticulatedInertia<S>& a, const Spatial<S>& v) {
  // sums of two short chains instead of one long
  return {a.aa * v.ang + a.al * v.lin, transposed_times(a.al, v.ang) + a.ll * v.lin};
}
/// Momentum I v: the same operations as for the articulated inertia, those with zero left out.
template <class S>
STICKSLIP_INLINE Spatial<S> operator*(const RigidInertia<S>& a, const Spatial<S>& v) {
  const Vec3<S>&h = a.h, &w = v.ang, &l = v.lin;
  const Vec3<S> moment{madd(h.y, l.z, -(h.z * l.y)), nmadd(h.x, l.z, h.z * l.x),
                       madd(h.x, l.y, -(h.y * l.x))};
  const Vec3<S> force{nmadd(h.y, w.z, h.z * w.y), madd(h.x, w.z, -(h.z * w.x)),
                      nmadd(h.x, w.y, h.y * w.x)};
  return {a.rot * w + moment, force + l * a.mass};
}
/// I - sum of u u^T: what is left of the inertia when joints with these U are free to move. Number
/// by number, so that there are few values to hold.
template <class S, class... U>
STICKSLIP_INLINE ArticulatedInertia<S> without(const ArticulatedInertia<S>& i, const U&... u) {
  ArticulatedInertia<S> r = i;
  ((r.aa.xx = nmadd(u.ang.x, u.ang.x, r.aa.xx)), ...);
  ((r.aa.xy = nmadd(u.ang.x, u.ang.y, r.aa.xy)), ...);
  ((r.aa.xz = nmadd(u.ang.x, u.ang.z, r.aa.xz)), ...);
  ((r.aa.yy = nmadd(u.ang.y, u.ang.y, r.aa.yy)), ...);
  ((r.aa.yz = nmadd(u.ang.y, u.ang.z, r.aa.yz)), ...);
  ((r.aa.zz = nmadd(u.ang.z, u.ang.z, r.aa.zz)), ...);
  ((r.al.m[0] = nmadd(u.ang.x, u.lin.x, r.al.m[0])), ...);
  ((r.al.m[1] = nmadd(u.ang.x, u.lin.y, r.al.m[1])), ...);
  ((r.al.m[2] = nmadd(u.ang.x, u.lin.z, r.al.m[2])), ...);
  ((r.al.m[3] = nmadd(u.ang.y, u.lin.x, r.al.m[3])), ...);
  ((r.al.m[4] = nmadd(u.ang.y, u.lin.y, r.al.m[4])), ...);
  ((r.al.m[5] = nmadd(u.ang.y, u.lin.z, r.al.m[5])), ...);
  ((r.al.m[6] = nmadd(u.ang.z, u.lin.x, r.al.m[6])), ...);
  ((r.al.m[7] = nmadd(u.ang.z, u.lin.y, r.al.m[7])), ...);
  ((r.al.m[8] = nmadd(u.ang.z, u.lin.z, r.al.m[8])), ...);
  ((r.ll.xx = nmadd(u.lin.x, u.lin.x, r.ll.xx)), ...);
  ((r.ll.xy = nmadd(u.lin.x, u.lin.y, r.ll.xy)), ...);
  ((r.ll.xz = nmadd(u.lin.x, u.lin.z, r.ll.xz)), ...);
  ((r.ll.yy = nmadd(u.lin.y, u.lin.y, r.ll.yy)), ...);
  ((r.ll.yz = nmadd(u.lin.y, u.lin.z, r.ll.yz)), ...);
  ((r.ll.zz = nmadd(u.lin.z, u.lin.z, r.ll.zz)), ...);
  return r;
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
