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
/// Momentum I v.
template <class S>
STICKSLIP_INLINE Spatial<S> operator*(const RigidInertia<S>& a, const Spatial<S>& v) {
  return {madd(a.rot, v.ang, cross(a.h, v.lin)), madd(v.lin, a.mass, -cross(a.h, v.ang))};
}
/// A with A r + a the acceleration of the point r of a body, a that of its point at the reference:
/// [alpha]x + w w^T - |w|^2.
template <class S>
STICKSLIP_INLINE Mat3<S> acceleration_field(const Vec3<S>& w, const Vec3<S>& alpha) {
  const S yy = w.y * w.y, zz = w.z * w.z;
  return {{nmadd(w.y, w.y, -zz), madd(w.x, w.y, -alpha.z), madd(w.x, w.z, alpha.y),
           madd(w.x, w.y, alpha.z), nmadd(w.x, w.x, -zz), madd(w.y, w.z, -alpha.x),
           madd(w.x, w.z, -alpha.y), madd(w.y, w.z, alpha.x), nmadd(w.x, w.x, -yy)}};
}
/// `field` becomes the acceleration_field of another body that shares its acceleration at the point
/// p; so `a`, at the reference, becomes that body's. Row by row: nine numbers less to hold.
template <class S>
STICKSLIP_INLINE void change_field(const Vec3<S>& w, const Vec3<S>& alpha, const Vec3<S>& p,
                                   Mat3<S>& field, Vec3<S>& a) {
  const S yy = w.y * w.y, zz = w.z * w.z;
  const auto change_row = [&](S& x, S& y, S& z, const Vec3<S>& row, S& sum)
                              __attribute__((always_inline)) {
    sum = madd(z - row.z, p.z, madd(y - row.y, p.y, madd(x - row.x, p.x, sum)));
    x = row.x, y = row.y, z = row.z;
  };
  S* m = field.m;
  change_row(m[0], m[1], m[2],
             {nmadd(w.y, w.y, -zz), madd(w.x, w.y, -alpha.z), madd(w.x, w.z, alpha.y)}, a.x);
  change_row(m[3], m[4], m[5],
             {madd(w.x, w.y, alpha.z), nmadd(w.x, w.x, -zz), madd(w.y, w.z, -alpha.x)}, a.y);
  change_row(m[6], m[7], m[8],
             {madd(w.x, w.z, -alpha.y), madd(w.y, w.z, alpha.x), nmadd(w.x, w.x, -yy)}, a.z);
}
/// Force that gives a body with angular velocity w the angular acceleration a.ang, its point at the
/// reference the acceleration a.lin; `field` is the acceleration_field.
template <class S>
STICKSLIP_INLINE Spatial<S> inertial_force(const RigidInertia<S>& i, const Vec3<S>& w,
                                           const Spatial<S>& a, const Mat3<S>& field) {
  return {cross(w, i.rot * w, madd(i.rot, a.ang, cross(i.h, a.lin))),
          madd(field, i.h, a.lin * i.mass)};
}
/// Inertia of a body with mass m, center of mass c and inertia `about_com`, seen from the reference
/// point.
template <class S>
STICKSLIP_INLINE RigidInertia<S> inertia_at_reference(S m, const Vec3<S>& c,
                                                      const Sym3<S>& about_com) {
  const Vec3<S> h = c * m;
  const S xx = h.x * c.x, yy = h.y * c.y, zz = h.z * c.z;
  return {m,
          h,
          {about_com.xx + (yy + zz), nmadd(h.x, c.y, about_com.xy), nmadd(h.x, c.z, about_com.xz),
           about_com.yy + (xx + zz), nmadd(h.y, c.z, about_com.yz), about_com.zz + (xx + yy)}};
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
STICKSLIP_INLINE Spatial<S> operator*(const ArticulatedInertia<S>& a, const Spatial<S>& v) {
  return {madd(a.aa, v.ang, a.al * v.lin), transposed_madd(a.al, v.ang, a.ll * v.lin)};
}
/// I - u (u / d)^T: what is left of the inertia when a joint with u = I s, d = s . u is free to
/// move.
template <class S>
STICKSLIP_INLINE ArticulatedInertia<S> without(const ArticulatedInertia<S>& i, const Spatial<S>& u,
                                               const Spatial<S>& u_over_d) {
  const Vec3<S>&n = u.ang, &f = u.lin, &a = u_over_d.ang, &b = u_over_d.lin;
  ArticulatedInertia<S> r;
  r.aa = {nmadd(a.x, n.x, i.aa.xx), nmadd(a.x, n.y, i.aa.xy), nmadd(a.x, n.z, i.aa.xz),
          nmadd(a.y, n.y, i.aa.yy), nmadd(a.y, n.z, i.aa.yz), nmadd(a.z, n.z, i.aa.zz)};
  r.al = {{nmadd(a.x, f.x, i.al.m[0]), nmadd(a.x, f.y, i.al.m[1]), nmadd(a.x, f.z, i.al.m[2]),
           nmadd(a.y, f.x, i.al.m[3]), nmadd(a.y, f.y, i.al.m[4]), nmadd(a.y, f.z, i.al.m[5]),
           nmadd(a.z, f.x, i.al.m[6]), nmadd(a.z, f.y, i.al.m[7]), nmadd(a.z, f.z, i.al.m[8])}};
  r.ll = {nmadd(b.x, f.x, i.ll.xx), nmadd(b.x, f.y, i.ll.xy), nmadd(b.x, f.z, i.ll.xz),
          nmadd(b.y, f.y, i.ll.yy), nmadd(b.y, f.z, i.ll.yz), nmadd(b.z, f.z, i.ll.zz)};
  return r;
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
