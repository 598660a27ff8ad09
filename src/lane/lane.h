// The scalar S of every kernel: double, float, or a pack of them, one environment (or one branch of
// a tree) per lane.
//
// Kernels use only what this folder defines: + - * /, madd, sqrt, compare, select, any/all and the
// polynomials of math.h. Each is one correctly rounded IEEE 754 operation, so a lane's bits depend
// neither on the width nor on its neighbors.
#pragma once

// Kernels are compiled once per instruction set, each time in an inline namespace of their own: two
// functions of one name with different instructions must not meet in the linker.
#ifndef STICKSLIP_KERNELS
#define STICKSLIP_KERNELS baseline
#endif

#define STICKSLIP_INLINE inline __attribute__((always_inline))
// The same after the parameters of a lambda.
#define STICKSLIP_LAMBDA __attribute__((always_inline))

namespace stickslip::inline STICKSLIP_KERNELS {

/// What a scalar type is made of: `Value` (one lane), `Mask` (result of a comparison), `kWidth`
/// (lanes).
template <class S>
struct ScalarTraits;

template <>
struct ScalarTraits<double> {
  using Value = double;
  using Mask = bool;
  static constexpr int kWidth = 1;
};

template <>
struct ScalarTraits<float> {
  using Value = float;
  using Mask = bool;
  static constexpr int kWidth = 1;
};

template <class S>
using Value = typename ScalarTraits<S>::Value;
template <class S>
using Mask = typename ScalarTraits<S>::Mask;

/// A constant of S from a double literal.
template <class S>
STICKSLIP_INLINE S constant(double x) {
  return S(static_cast<Value<S>>(x));
}

/// No lane.
template <class S>
STICKSLIP_INLINE Mask<S> none() {
  return Mask<S>{};
}

// One fused multiply-add a * b + c: always exactly one rounding, on every machine.
STICKSLIP_INLINE double madd(double a, double b, double c) { return __builtin_fma(a, b, c); }
STICKSLIP_INLINE float madd(float a, float b, float c) { return __builtin_fmaf(a, b, c); }
STICKSLIP_INLINE double sqrt(double a) { return __builtin_sqrt(a); }
STICKSLIP_INLINE float sqrt(float a) { return __builtin_sqrtf(a); }
STICKSLIP_INLINE double select(bool m, double a, double b) { return m ? a : b; }
STICKSLIP_INLINE float select(bool m, float a, float b) { return m ? a : b; }
STICKSLIP_INLINE bool any(bool m) { return m; }
STICKSLIP_INLINE bool all(bool m) { return m; }

// Lane access, for loading and storing only: no kernel value may come from a horizontal operation.
STICKSLIP_INLINE double get_lane(double x, int) { return x; }
STICKSLIP_INLINE float get_lane(float x, int) { return x; }
STICKSLIP_INLINE bool get_lane(bool x, int) { return x; }
STICKSLIP_INLINE void set_lane(double& x, int, double v) { x = v; }
STICKSLIP_INLINE void set_lane(float& x, int, float v) { x = v; }

template <class S>
STICKSLIP_INLINE S nmadd(S a, S b, S c) {  // c - a * b, fused
  return madd(-a, b, c);
}
// Clears the sign, also of zero.
STICKSLIP_INLINE double abs(double a) { return __builtin_fabs(a); }
STICKSLIP_INLINE float abs(float a) { return __builtin_fabsf(a); }
template <class S>
STICKSLIP_INLINE S min(S a, S b) {
  return select(b < a, b, a);
}
template <class S>
STICKSLIP_INLINE S max(S a, S b) {
  return select(a < b, b, a);
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
