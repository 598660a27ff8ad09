// Pack<T, W>: W lanes of T over a compiler vector. Why not std::experimental::simd:
// docs/design/002-pack.md.
#pragma once
#include "lane/lane.h"
#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

namespace stickslip::inline STICKSLIP_KERNELS {

// GCC 12 takes a dependent vector_size typedef for its element type in overload resolution, hence
// one struct per width.
template <class T, int W>
struct PackStorage;
#define STICKSLIP_PACK_STORAGE(T, I, W)                           \
  template <>                                                     \
  struct PackStorage<T, W> {                                      \
    typedef T Vector __attribute__((vector_size(sizeof(T) * W))); \
    typedef I Ints __attribute__((vector_size(sizeof(I) * W)));   \
  };
STICKSLIP_PACK_STORAGE(double, long long, 2)
STICKSLIP_PACK_STORAGE(double, long long, 4)
STICKSLIP_PACK_STORAGE(double, long long, 8)
STICKSLIP_PACK_STORAGE(float, int, 4)
STICKSLIP_PACK_STORAGE(float, int, 8)
STICKSLIP_PACK_STORAGE(float, int, 16)
#undef STICKSLIP_PACK_STORAGE

/// One truth value per lane. No conversion to bool: a kernel that branches on one lane does not
/// compile.
template <class T, int W>
struct PackMask {
  typename PackStorage<T, W>::Ints v;  // 0 or -1
  friend STICKSLIP_INLINE PackMask operator&(PackMask a, PackMask b) { return {a.v & b.v}; }
  friend STICKSLIP_INLINE PackMask operator|(PackMask a, PackMask b) { return {a.v | b.v}; }
  friend STICKSLIP_INLINE PackMask operator!(PackMask a) { return {~a.v}; }
};

template <class T, int W>
struct Pack {
  using Vector = typename PackStorage<T, W>::Vector;
  Vector v;
  Pack() = default;
  STICKSLIP_INLINE Pack(Vector x) : v(x) {}
  STICKSLIP_INLINE explicit Pack(T x) : v(x - Vector{}) {}  // x - 0 is x, so no operation
  friend STICKSLIP_INLINE Pack operator+(Pack a, Pack b) { return a.v + b.v; }
  friend STICKSLIP_INLINE Pack operator-(Pack a, Pack b) { return a.v - b.v; }
  friend STICKSLIP_INLINE Pack operator*(Pack a, Pack b) { return a.v * b.v; }
  friend STICKSLIP_INLINE Pack operator/(Pack a, Pack b) { return a.v / b.v; }
  friend STICKSLIP_INLINE Pack operator-(Pack a) { return -a.v; }
  STICKSLIP_INLINE Pack& operator+=(Pack b) { return v += b.v, *this; }
  STICKSLIP_INLINE Pack& operator-=(Pack b) { return v -= b.v, *this; }
  STICKSLIP_INLINE Pack& operator*=(Pack b) { return v *= b.v, *this; }
  friend STICKSLIP_INLINE PackMask<T, W> operator<(Pack a, Pack b) { return {a.v < b.v}; }
  friend STICKSLIP_INLINE PackMask<T, W> operator>(Pack a, Pack b) { return {a.v > b.v}; }
  friend STICKSLIP_INLINE PackMask<T, W> operator<=(Pack a, Pack b) { return {a.v <= b.v}; }
  friend STICKSLIP_INLINE PackMask<T, W> operator>=(Pack a, Pack b) { return {a.v >= b.v}; }
};

template <class T, int W>
struct ScalarTraits<Pack<T, W>> {
  using Value = T;
  using Mask = PackMask<T, W>;
  static constexpr int kWidth = W;
};

template <class T, int W>
STICKSLIP_INLINE Pack<T, W> select(PackMask<T, W> m, Pack<T, W> a, Pack<T, W> b) {
  return m.v ? a.v : b.v;
}
template <class T, int W>
STICKSLIP_INLINE bool any(PackMask<T, W> m) {
  bool r = false;
  for (int i = 0; i < W; ++i) r |= m.v[i] != 0;
  return r;
}
template <class T, int W>
STICKSLIP_INLINE bool all(PackMask<T, W> m) {
  return !any(!m);
}

template <class T, int W>
STICKSLIP_INLINE T get_lane(const Pack<T, W>& x, int i) {
  return reinterpret_cast<const T*>(&x)[i];
}
template <class T, int W>
STICKSLIP_INLINE bool get_lane(const PackMask<T, W>& m, int i) {
  return m.v[i] != 0;
}
template <class T, int W>
STICKSLIP_INLINE void set_lane(Pack<T, W>& x, int i, T v) {
  reinterpret_cast<T*>(&x)[i] = v;
}

// Widths without an instruction of their own (a pack wider than the register) go lane by lane; the
// bits are the same.
template <class T, int W>
STICKSLIP_INLINE Pack<T, W> madd(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) {
  Pack<T, W> r;
  for (int i = 0; i < W; ++i) r.v[i] = madd(T(a.v[i]), T(b.v[i]), T(c.v[i]));
  return r;
}
template <class T, int W>
STICKSLIP_INLINE Pack<T, W> sqrt(Pack<T, W> a) {
  Pack<T, W> r;
  for (int i = 0; i < W; ++i) r.v[i] = sqrt(T(a.v[i]));
  return r;
}

#define STICKSLIP_PACK_OPS(T, W, FMA, SQRT)                                                  \
  STICKSLIP_INLINE Pack<T, W> madd(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) { return FMA; } \
  STICKSLIP_INLINE Pack<T, W> sqrt(Pack<T, W> a) { return SQRT; }
#if defined(__AVX2__) && defined(__FMA__)
STICKSLIP_PACK_OPS(double, 2, _mm_fmadd_pd(a.v, b.v, c.v), _mm_sqrt_pd(a.v))
STICKSLIP_PACK_OPS(double, 4, _mm256_fmadd_pd(a.v, b.v, c.v), _mm256_sqrt_pd(a.v))
STICKSLIP_PACK_OPS(float, 4, _mm_fmadd_ps(a.v, b.v, c.v), _mm_sqrt_ps(a.v))
STICKSLIP_PACK_OPS(float, 8, _mm256_fmadd_ps(a.v, b.v, c.v), _mm256_sqrt_ps(a.v))
STICKSLIP_INLINE bool any(PackMask<double, 4> m) {
  return _mm256_movemask_pd(_mm256_castsi256_pd((__m256i)m.v));
}
STICKSLIP_INLINE bool any(PackMask<float, 8> m) {
  return _mm256_movemask_ps(_mm256_castsi256_ps((__m256i)m.v));
}
#if defined(__AVX512F__)
STICKSLIP_PACK_OPS(double, 8, _mm512_fmadd_pd(a.v, b.v, c.v), _mm512_sqrt_pd(a.v))
STICKSLIP_PACK_OPS(float, 16, _mm512_fmadd_ps(a.v, b.v, c.v), _mm512_sqrt_ps(a.v))
#else
// Twice as wide as the register: two halves.
#define STICKSLIP_PACK_HALVES(T, W)                                            \
  STICKSLIP_INLINE Pack<T, W> madd(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) { \
    Pack<T, W / 2> x[2], y[2], z[2];                                           \
    __builtin_memcpy(x, &a, sizeof a), __builtin_memcpy(y, &b, sizeof b);      \
    __builtin_memcpy(z, &c, sizeof c);                                         \
    for (int i = 0; i < 2; ++i) z[i] = madd(x[i], y[i], z[i]);                 \
    __builtin_memcpy(&c, z, sizeof c);                                         \
    return c;                                                                  \
  }                                                                            \
  STICKSLIP_INLINE Pack<T, W> sqrt(Pack<T, W> a) {                             \
    Pack<T, W / 2> x[2];                                                       \
    __builtin_memcpy(x, &a, sizeof a);                                         \
    for (int i = 0; i < 2; ++i) x[i] = sqrt(x[i]);                             \
    __builtin_memcpy(&a, x, sizeof a);                                         \
    return a;                                                                  \
  }                                                                            \
  STICKSLIP_INLINE bool any(PackMask<T, W> m) {                                \
    PackMask<T, W / 2> x[2];                                                   \
    __builtin_memcpy(x, &m, sizeof m);                                         \
    return any(x[0] | x[1]);                                                   \
  }
STICKSLIP_PACK_HALVES(double, 8)
STICKSLIP_PACK_HALVES(float, 16)
#undef STICKSLIP_PACK_HALVES
#endif
#elif defined(__ARM_NEON)
STICKSLIP_PACK_OPS(double, 2, vfmaq_f64(c.v, a.v, b.v), vsqrtq_f64(a.v))
STICKSLIP_PACK_OPS(float, 4, vfmaq_f32(c.v, a.v, b.v), vsqrtq_f32(a.v))
#endif
#undef STICKSLIP_PACK_OPS

}  // namespace stickslip::inline STICKSLIP_KERNELS
