// The numbers that a vector, matrix or inertia is made of, one by one and in the order of memory.
// Everything is written out: a value whose address is taken, or that is indexed by a loop, would
// not stay in registers.
#pragma once
#include "spatial/spatial.h"

namespace stickslip::inline STICKSLIP_KERNELS {

/// How many, in an X.
template <template <class> class X>
inline constexpr int kNumbersIn = sizeof(X<double>) / sizeof(double);

/// make: the X whose numbers are f(at), f(at + 1), ...; visit: calls f(index, number) of each.
template <class S, template <class> class X>
struct Numbers;

template <class S>
struct Numbers<S, Vec3> {
  template <class F>
  static STICKSLIP_INLINE Vec3<S> make(const F& f, int at = 0) {
    return {f(at), f(at + 1), f(at + 2)};
  }
  template <class F>
  static STICKSLIP_INLINE void visit(const Vec3<S>& v, const F& f, int at = 0) {
    f(at, v.x), f(at + 1, v.y), f(at + 2, v.z);
  }
};

template <class S>
struct Numbers<S, Sym3> {
  template <class F>
  static STICKSLIP_INLINE Sym3<S> make(const F& f, int at = 0) {
    return {f(at), f(at + 1), f(at + 2), f(at + 3), f(at + 4), f(at + 5)};
  }
  template <class F>
  static STICKSLIP_INLINE void visit(const Sym3<S>& a, const F& f, int at = 0) {
    f(at, a.xx), f(at + 1, a.xy), f(at + 2, a.xz);
    f(at + 3, a.yy), f(at + 4, a.yz), f(at + 5, a.zz);
  }
};

template <class S>
struct Numbers<S, Mat3> {
  template <class F>
  static STICKSLIP_INLINE Mat3<S> make(const F& f, int at = 0) {
    return {{f(at), f(at + 1), f(at + 2), f(at + 3), f(at + 4), f(at + 5), f(at + 6), f(at + 7),
             f(at + 8)}};
  }
  template <class F>
  static STICKSLIP_INLINE void visit(const Mat3<S>& a, const F& f, int at = 0) {
    f(at, a.m[0]), f(at + 1, a.m[1]), f(at + 2, a.m[2]);
    f(at + 3, a.m[3]), f(at + 4, a.m[4]), f(at + 5, a.m[5]);
    f(at + 6, a.m[6]), f(at + 7, a.m[7]), f(at + 8, a.m[8]);
  }
};

template <class S>
struct Numbers<S, Spatial> {
  template <class F>
  static STICKSLIP_INLINE Spatial<S> make(const F& f, int at = 0) {
    return {Numbers<S, Vec3>::make(f, at), Numbers<S, Vec3>::make(f, at + 3)};
  }
  template <class F>
  static STICKSLIP_INLINE void visit(const Spatial<S>& v, const F& f, int at = 0) {
    Numbers<S, Vec3>::visit(v.ang, f, at), Numbers<S, Vec3>::visit(v.lin, f, at + 3);
  }
};

template <class S>
struct Numbers<S, RigidInertia> {
  template <class F>
  static STICKSLIP_INLINE RigidInertia<S> make(const F& f, int at = 0) {
    return {f(at), Numbers<S, Vec3>::make(f, at + 1), Numbers<S, Sym3>::make(f, at + 4)};
  }
  template <class F>
  static STICKSLIP_INLINE void visit(const RigidInertia<S>& a, const F& f, int at = 0) {
    f(at, a.mass), Numbers<S, Vec3>::visit(a.h, f, at + 1);
    Numbers<S, Sym3>::visit(a.rot, f, at + 4);
  }
};

template <class S>
struct Numbers<S, ArticulatedInertia> {
  template <class F>
  static STICKSLIP_INLINE ArticulatedInertia<S> make(const F& f, int at = 0) {
    return {Numbers<S, Sym3>::make(f, at), Numbers<S, Mat3>::make(f, at + 6),
            Numbers<S, Sym3>::make(f, at + 15)};
  }
  template <class F>
  static STICKSLIP_INLINE void visit(const ArticulatedInertia<S>& a, const F& f, int at = 0) {
    Numbers<S, Sym3>::visit(a.aa, f, at), Numbers<S, Mat3>::visit(a.al, f, at + 6);
    Numbers<S, Sym3>::visit(a.ll, f, at + 15);
  }
};

/// to = from, number by number: GCC 12 holds in memory what is copied whole.
template <template <class> class X, class S>
STICKSLIP_INLINE void store(const X<S>& from, X<S>& to) {
  S* numbers = reinterpret_cast<S*>(&to);
  Numbers<S, X>::visit(from, [&](int k, const S& x) STICKSLIP_LAMBDA { numbers[k] = x; });
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
