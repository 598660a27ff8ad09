// Three-vectors and 3x3 matrices of a scalar S.
#pragma once
#include "lane/lane.h"

namespace stickslip::inline STICKSLIP_KERNELS {

template <class S>
struct Vec3 {
  S x, y, z;
};

template <class S>
STICKSLIP_INLINE Vec3<S> zero3() {
  const S o = constant<S>(0);
  return {o, o, o};
}
template <class S>
STICKSLIP_INLINE Vec3<S> operator+(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class S>
STICKSLIP_INLINE Vec3<S> operator-(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class S>
STICKSLIP_INLINE Vec3<S> operator-(const Vec3<S>& a) {
  return {-a.x, -a.y, -a.z};
}
template <class S>
STICKSLIP_INLINE Vec3<S> operator*(const Vec3<S>& a, S k) {
  return {a.x * k, a.y * k, a.z * k};
}
/// a * k + c, fused.
template <class S>
STICKSLIP_INLINE Vec3<S> madd(const Vec3<S>& a, S k, const Vec3<S>& c) {
  return {madd(a.x, k, c.x), madd(a.y, k, c.y), madd(a.z, k, c.z)};
}
/// c - a * k, fused.
template <class S>
STICKSLIP_INLINE Vec3<S> nmadd(const Vec3<S>& a, S k, const Vec3<S>& c) {
  return {nmadd(a.x, k, c.x), nmadd(a.y, k, c.y), nmadd(a.z, k, c.z)};
}
template <class S>
STICKSLIP_INLINE S dot(const Vec3<S>& a, const Vec3<S>& b) {
  return madd(a.z, b.z, madd(a.y, b.y, a.x * b.x));
}
/// a . b + c
template <class S>
STICKSLIP_INLINE S dot(const Vec3<S>& a, const Vec3<S>& b, S c) {
  return madd(a.z, b.z, madd(a.y, b.y, madd(a.x, b.x, c)));
}
template <class S>
STICKSLIP_INLINE Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return {nmadd(a.z, b.y, a.y * b.z), nmadd(a.x, b.z, a.z * b.x), nmadd(a.y, b.x, a.x * b.y)};
}
/// a x b + c
template <class S>
STICKSLIP_INLINE Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b, const Vec3<S>& c) {
  return {nmadd(a.z, b.y, madd(a.y, b.z, c.x)), nmadd(a.x, b.z, madd(a.z, b.x, c.y)),
          nmadd(a.y, b.x, madd(a.x, b.y, c.z))};
}

/// Row-major.
template <class S>
struct Mat3 {
  S m[9];
};

template <class S>
STICKSLIP_INLINE Vec3<S> operator*(const Mat3<S>& a, const Vec3<S>& b) {
  const S* m = a.m;
  return {madd(m[2], b.z, madd(m[1], b.y, m[0] * b.x)),
          madd(m[5], b.z, madd(m[4], b.y, m[3] * b.x)),
          madd(m[8], b.z, madd(m[7], b.y, m[6] * b.x))};
}
/// A b + c
template <class S>
STICKSLIP_INLINE Vec3<S> madd(const Mat3<S>& a, const Vec3<S>& b, const Vec3<S>& c) {
  const S* m = a.m;
  return {madd(m[2], b.z, madd(m[1], b.y, madd(m[0], b.x, c.x))),
          madd(m[5], b.z, madd(m[4], b.y, madd(m[3], b.x, c.y))),
          madd(m[8], b.z, madd(m[7], b.y, madd(m[6], b.x, c.z)))};
}
/// A^T b
template <class S>
STICKSLIP_INLINE Vec3<S> transposed_times(const Mat3<S>& a, const Vec3<S>& b) {
  const S* m = a.m;
  return {madd(m[6], b.z, madd(m[3], b.y, m[0] * b.x)),
          madd(m[7], b.z, madd(m[4], b.y, m[1] * b.x)),
          madd(m[8], b.z, madd(m[5], b.y, m[2] * b.x))};
}
/// A^T b + c
template <class S>
STICKSLIP_INLINE Vec3<S> transposed_madd(const Mat3<S>& a, const Vec3<S>& b, const Vec3<S>& c) {
  const S* m = a.m;
  return {madd(m[6], b.z, madd(m[3], b.y, madd(m[0], b.x, c.x))),
          madd(m[7], b.z, madd(m[4], b.y, madd(m[1], b.x, c.y))),
          madd(m[8], b.z, madd(m[5], b.y, madd(m[2], b.x, c.z)))};
}
template <class S>
STICKSLIP_INLINE Mat3<S> operator*(const Mat3<S>& a, const Mat3<S>& b) {
  const S *x = a.m, *y = b.m;  // written out, so that the values stay in registers
  return {{madd(x[2], y[6], madd(x[1], y[3], x[0] * y[0])),
           madd(x[2], y[7], madd(x[1], y[4], x[0] * y[1])),
           madd(x[2], y[8], madd(x[1], y[5], x[0] * y[2])),
           madd(x[5], y[6], madd(x[4], y[3], x[3] * y[0])),
           madd(x[5], y[7], madd(x[4], y[4], x[3] * y[1])),
           madd(x[5], y[8], madd(x[4], y[5], x[3] * y[2])),
           madd(x[8], y[6], madd(x[7], y[3], x[6] * y[0])),
           madd(x[8], y[7], madd(x[7], y[4], x[6] * y[1])),
           madd(x[8], y[8], madd(x[7], y[5], x[6] * y[2]))}};
}

/// Symmetric: xx xy xz yy yz zz.
template <class S>
struct Sym3 {
  S xx, xy, xz, yy, yz, zz;
};

template <class S>
STICKSLIP_INLINE Sym3<S> operator+(const Sym3<S>& a, const Sym3<S>& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
}
template <class S>
STICKSLIP_INLINE Vec3<S> operator*(const Sym3<S>& a, const Vec3<S>& b) {
  return {madd(a.xz, b.z, madd(a.xy, b.y, a.xx * b.x)),
          madd(a.yz, b.z, madd(a.yy, b.y, a.xy * b.x)),
          madd(a.zz, b.z, madd(a.yz, b.y, a.xz * b.x))};
}
/// A b + c
template <class S>
STICKSLIP_INLINE Vec3<S> madd(const Sym3<S>& a, const Vec3<S>& b, const Vec3<S>& c) {
  return {madd(a.xz, b.z, madd(a.xy, b.y, madd(a.xx, b.x, c.x))),
          madd(a.yz, b.z, madd(a.yy, b.y, madd(a.xy, b.x, c.y))),
          madd(a.zz, b.z, madd(a.yz, b.y, madd(a.xz, b.x, c.z)))};
}
/// R A R^T for a rotation R: A = zz 1 + B with B_zz = 0, and the trace stays.
template <class S, class K>
STICKSLIP_INLINE Sym3<S> rotate(const Mat3<S>& r, const Sym3<K>& a) {
  const S xx(a.xx - a.zz), yy(a.yy - a.zz), xy(a.xy), xz(a.xz), yz(a.yz), zz(a.zz);
  const S* m = r.m;
  // B's columns, turned
  const Vec3<S> x{madd(m[2], xz, madd(m[1], xy, m[0] * xx)),
                  madd(m[5], xz, madd(m[4], xy, m[3] * xx)),
                  madd(m[8], xz, madd(m[7], xy, m[6] * xx))};
  const Vec3<S> y{madd(m[2], yz, madd(m[1], yy, m[0] * xy)),
                  madd(m[5], yz, madd(m[4], yy, m[3] * xy)),
                  madd(m[8], yz, madd(m[7], yy, m[6] * xy))};
  const Vec3<S> z{madd(m[1], yz, m[0] * xz), madd(m[4], yz, m[3] * xz), madd(m[7], yz, m[6] * xz)};
  const S first = madd(z.x, m[2], madd(y.x, m[1], madd(x.x, m[0], zz)));
  const S second = madd(z.y, m[5], madd(y.y, m[4], madd(x.y, m[3], zz)));
  return {first,
          madd(z.x, m[5], madd(y.x, m[4], x.x * m[3])),
          madd(z.x, m[8], madd(y.x, m[7], x.x * m[6])),
          second,
          madd(z.y, m[8], madd(y.y, m[7], x.y * m[6])),
          (S(a.xx + a.yy + a.zz) - first) - second};
}

/// Rotation matrix of the unit quaternion w x y z.
template <class S>
STICKSLIP_INLINE Mat3<S> rotation(const S q[4]) {
  const S one = constant<S>(1), two = constant<S>(2);
  const S w = q[0], x = q[1], y = q[2], z = q[3];
  const S xx = x * x, yy = y * y, zz = z * z, xy = x * y, xz = x * z, yz = y * z;
  const S wx = w * x, wy = w * y, wz = w * z;
  return {{nmadd(two, yy + zz, one), two * (xy - wz), two * (xz + wy), two * (xy + wz),
           nmadd(two, xx + zz, one), two * (yz - wx), two * (xz - wy), two * (yz + wx),
           nmadd(two, xx + yy, one)}};
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
