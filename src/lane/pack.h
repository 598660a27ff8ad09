// Pack<T, W>: W lanes of T over a compiler vector. Why not std::experimental::simd:
// docs/design/002-pack.md.
#pragma once
#include "lane/lane.h"
#if defined(__AVX2__)
#pragma GCC diagnostic push
#if !defined(__clang__)
// GCC 12 finds fault with its own header.
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include <immintrin.h>
#pragma GCC diagnostic pop
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

#if defined(__AVX512VL__) && defined(__AVX512DQ__)
#define STICKSLIP_MASK_BITS 1
#else
#define STICKSLIP_MASK_BITS 0
#endif

/// One truth value per lane. No conversion to bool: a kernel that branches on one lane does not
/// compile.
#if STICKSLIP_MASK_BITS
template <int W>
struct MaskBits {
  using Type = unsigned char;
};
template <>
struct MaskBits<16> {
  using Type = unsigned short;
};
template <class T, int W>
struct PackMask {
  using Bits = typename MaskBits<W>::Type;
  static constexpr unsigned kAll = (1u << W) - 1;
  Bits v;  // lane 0 is the lowest; bits above W are 0
  friend STICKSLIP_INLINE PackMask operator&(PackMask a, PackMask b) { return {Bits(a.v & b.v)}; }
  friend STICKSLIP_INLINE PackMask operator|(PackMask a, PackMask b) { return {Bits(a.v | b.v)}; }
  friend STICKSLIP_INLINE PackMask operator!(PackMask a) { return {Bits(~a.v & kAll)}; }
};
#else
template <class T, int W>
struct PackMask {
  typename PackStorage<T, W>::Ints v;  // 0 or -1
  friend STICKSLIP_INLINE PackMask operator&(PackMask a, PackMask b) { return {a.v & b.v}; }
  friend STICKSLIP_INLINE PackMask operator|(PackMask a, PackMask b) { return {a.v | b.v}; }
  friend STICKSLIP_INLINE PackMask operator!(PackMask a) { return {~a.v}; }
};
#endif

template <class T, int W>
struct Pack {
  using Vector = typename PackStorage<T, W>::Vector;
  Vector v;
  Pack() = default;
  STICKSLIP_INLINE Pack(Vector x) : v(x) {}
  // x - 0 is x to the bit, so this is a broadcast; x + 0 would be an addition: it turns -0 into 0.
  STICKSLIP_INLINE explicit Pack(T x) : v(x - Vector{}) {}
  friend STICKSLIP_INLINE Pack operator+(Pack a, Pack b) { return a.v + b.v; }
  friend STICKSLIP_INLINE Pack operator-(Pack a, Pack b) { return a.v - b.v; }
  friend STICKSLIP_INLINE Pack operator*(Pack a, Pack b) { return a.v * b.v; }
  friend STICKSLIP_INLINE Pack operator/(Pack a, Pack b) { return a.v / b.v; }
  friend STICKSLIP_INLINE Pack operator-(Pack a) { return -a.v; }
  STICKSLIP_INLINE Pack& operator+=(Pack b) { return v += b.v, *this; }
  STICKSLIP_INLINE Pack& operator-=(Pack b) { return v -= b.v, *this; }
  STICKSLIP_INLINE Pack& operator*=(Pack b) { return v *= b.v, *this; }
};

template <class T, int W>
struct ScalarTraits<Pack<T, W>> {
  using Value = T;
  using Mask = PackMask<T, W>;
  static constexpr int kWidth = W;
};

template <class T, int W>
STICKSLIP_INLINE Pack<T, W> abs(Pack<T, W> a) {  // clears the sign, also of NaN, like the scalar
  using Ints = typename PackStorage<T, W>::Ints;
  constexpr auto kMagnitude = sizeof(T) == 4 ? 0x7fffffffll : 0x7fffffffffffffffll;
  return typename Pack<T, W>::Vector(Ints(a.v) & (Ints{} + decltype(Ints{}[0] + 0)(kMagnitude)));
}

template <class T, int W>
STICKSLIP_INLINE T get_lane(const Pack<T, W>& x, int i) {
  return reinterpret_cast<const T*>(&x)[i];
}
template <class T, int W>
STICKSLIP_INLINE void set_lane(Pack<T, W>& x, int i, T v) {
  reinterpret_cast<T*>(&x)[i] = v;
}

// What compiler vectors do not give, or not well, in three ways: lane by lane, two halves of a pack
// wider than the register, an instruction. The bits are the same.
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
#if STICKSLIP_MASK_BITS
template <class T, int W>
STICKSLIP_INLINE bool any(PackMask<T, W> m) {
  return m.v != 0;
}
template <class T, int W>
STICKSLIP_INLINE bool all(PackMask<T, W> m) {
  return m.v == PackMask<T, W>::kAll;
}
template <class T, int W>
STICKSLIP_INLINE bool get_lane(PackMask<T, W> m, int i) {
  return m.v >> i & 1;
}
#else
template <class T, int W>
STICKSLIP_INLINE PackMask<T, W> operator<(Pack<T, W> a, Pack<T, W> b) {
  return {a.v < b.v};
}
template <class T, int W>
STICKSLIP_INLINE PackMask<T, W> operator<=(Pack<T, W> a, Pack<T, W> b) {
  return {a.v <= b.v};
}
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
STICKSLIP_INLINE bool get_lane(const PackMask<T, W>& m, int i) {
  return m.v[i] != 0;
}
#endif

#define STICKSLIP_PACK_OPS(T, W, FMA, SQRT)                                                  \
  STICKSLIP_INLINE Pack<T, W> madd(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) { return FMA; } \
  STICKSLIP_INLINE Pack<T, W> sqrt(Pack<T, W> a) { return SQRT; }
// The minimum of x86 is `x < y ? x : y`: with the operands swapped it is ours, also for NaN and for
// zeros of either sign. P: _mm, _mm256, _mm512; N: ps, pd.
#define STICKSLIP_PACK_X86(T, W, P, N)                                                          \
  STICKSLIP_PACK_OPS(T, W, P##_fmadd_##N(a.v, b.v, c.v), P##_sqrt_##N(a.v))                     \
  STICKSLIP_INLINE Pack<T, W> min(Pack<T, W> a, Pack<T, W> b) { return P##_min_##N(b.v, a.v); } \
  STICKSLIP_INLINE Pack<T, W> max(Pack<T, W> a, Pack<T, W> b) { return P##_max_##N(b.v, a.v); }

#if STICKSLIP_MASK_BITS
#define STICKSLIP_PACK_X86_BITS(T, W, P, N)                                          \
  STICKSLIP_PACK_X86(T, W, P, N)                                                     \
  STICKSLIP_INLINE PackMask<T, W> operator<(Pack<T, W> a, Pack<T, W> b) {            \
    return {P##_cmp_##N##_mask(a.v, b.v, _CMP_LT_OS)};                               \
  }                                                                                  \
  STICKSLIP_INLINE PackMask<T, W> operator<=(Pack<T, W> a, Pack<T, W> b) {           \
    return {P##_cmp_##N##_mask(a.v, b.v, _CMP_LE_OS)};                               \
  }                                                                                  \
  STICKSLIP_INLINE Pack<T, W> select(PackMask<T, W> m, Pack<T, W> a, Pack<T, W> b) { \
    return P##_mask_blend_##N(m.v, b.v, a.v);                                        \
  }
STICKSLIP_PACK_X86_BITS(double, 2, _mm, pd)
STICKSLIP_PACK_X86_BITS(double, 4, _mm256, pd)
STICKSLIP_PACK_X86_BITS(double, 8, _mm512, pd)
STICKSLIP_PACK_X86_BITS(float, 4, _mm, ps)
STICKSLIP_PACK_X86_BITS(float, 8, _mm256, ps)
STICKSLIP_PACK_X86_BITS(float, 16, _mm512, ps)
#undef STICKSLIP_PACK_X86_BITS
#elif defined(__AVX2__) && defined(__FMA__)
#define STICKSLIP_PACK_X86_INTS(T, W, P, N, FLOATS)                                  \
  STICKSLIP_PACK_X86(T, W, P, N)                                                     \
  STICKSLIP_INLINE Pack<T, W> select(PackMask<T, W> m, Pack<T, W> a, Pack<T, W> b) { \
    return P##_blendv_##N(b.v, a.v, (FLOATS)m.v);                                    \
  }                                                                                  \
  STICKSLIP_INLINE bool any(PackMask<T, W> m) { return P##_movemask_##N((FLOATS)m.v); }
STICKSLIP_PACK_X86_INTS(double, 2, _mm, pd, __m128d)
STICKSLIP_PACK_X86_INTS(double, 4, _mm256, pd, __m256d)
STICKSLIP_PACK_X86_INTS(float, 4, _mm, ps, __m128)
STICKSLIP_PACK_X86_INTS(float, 8, _mm256, ps, __m256)
#undef STICKSLIP_PACK_X86_INTS

template <class T, int W>
struct Halves {
  Pack<T, W / 2> x[2];
  STICKSLIP_INLINE explicit Halves(const Pack<T, W>& a) { __builtin_memcpy(x, &a, sizeof x); }
};
template <class T, int W>
STICKSLIP_INLINE Pack<T, W> join(Pack<T, W / 2> low, Pack<T, W / 2> high) {
  Pack<T, W> r;
  __builtin_memcpy(&r, &low, sizeof low);
  __builtin_memcpy(reinterpret_cast<char*>(&r) + sizeof low, &high, sizeof high);
  return r;
}
#define STICKSLIP_HALVES_OF_TWO(T, W, NAME, RESULT)                       \
  STICKSLIP_INLINE RESULT<T, W> NAME(Pack<T, W> a, Pack<T, W> b) {        \
    const Halves<T, W> x(a), y(b);                                        \
    RESULT<T, W / 2> r[2] = {NAME(x.x[0], y.x[0]), NAME(x.x[1], y.x[1])}; \
    RESULT<T, W> both;                                                    \
    __builtin_memcpy(&both, r, sizeof r);                                 \
    return both;                                                          \
  }
#define STICKSLIP_PACK_HALVES(T, W)                                                  \
  STICKSLIP_INLINE Pack<T, W> madd(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) {       \
    const Halves<T, W> x(a), y(b), z(c);                                             \
    return join<T, W>(madd(x.x[0], y.x[0], z.x[0]), madd(x.x[1], y.x[1], z.x[1]));   \
  }                                                                                  \
  STICKSLIP_INLINE Pack<T, W> sqrt(Pack<T, W> a) {                                   \
    const Halves<T, W> x(a);                                                         \
    return join<T, W>(sqrt(x.x[0]), sqrt(x.x[1]));                                   \
  }                                                                                  \
  STICKSLIP_HALVES_OF_TWO(T, W, min, Pack)                                           \
  STICKSLIP_HALVES_OF_TWO(T, W, max, Pack)                                           \
  STICKSLIP_HALVES_OF_TWO(T, W, operator<, PackMask)                                 \
  STICKSLIP_HALVES_OF_TWO(T, W, operator<=, PackMask)                                \
  STICKSLIP_INLINE Pack<T, W> select(PackMask<T, W> m, Pack<T, W> a, Pack<T, W> b) { \
    PackMask<T, W / 2> h[2];                                                         \
    __builtin_memcpy(h, &m, sizeof m);                                               \
    const Halves<T, W> x(a), y(b);                                                   \
    return join<T, W>(select(h[0], x.x[0], y.x[0]), select(h[1], x.x[1], y.x[1]));   \
  }                                                                                  \
  STICKSLIP_INLINE bool any(PackMask<T, W> m) {                                      \
    PackMask<T, W / 2> h[2];                                                         \
    __builtin_memcpy(h, &m, sizeof m);                                               \
    return any(h[0] | h[1]);                                                         \
  }
STICKSLIP_PACK_HALVES(double, 8)
STICKSLIP_PACK_HALVES(float, 16)
#undef STICKSLIP_PACK_HALVES
#undef STICKSLIP_HALVES_OF_TWO
#elif defined(__ARM_NEON)
STICKSLIP_PACK_OPS(double, 2, vfmaq_f64(c.v, a.v, b.v), vsqrtq_f64(a.v))
STICKSLIP_PACK_OPS(float, 4, vfmaq_f32(c.v, a.v, b.v), vsqrtq_f32(a.v))
#endif
#undef STICKSLIP_PACK_X86
#undef STICKSLIP_PACK_OPS

template <class T, int W>
STICKSLIP_INLINE PackMask<T, W> operator>(Pack<T, W> a, Pack<T, W> b) {
  return b < a;
}
template <class T, int W>
STICKSLIP_INLINE PackMask<T, W> operator>=(Pack<T, W> a, Pack<T, W> b) {
  return b <= a;
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
