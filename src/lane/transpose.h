// Rows of numbers, one per environment, to lanes and back: out[k] holds number k of W rows, which
// may lie anywhere in an array.
//
// Users' arrays are row-major (num_envs, n), so that NumPy, PyTorch and JAX share them as they are;
// packs want lane-major. A block of W x W numbers is turned in registers, log2 W rounds of
// interleaving (docs/design/009-batch-arrays.md).
#pragma once
#include "lane/pack.h"

namespace stickslip::inline STICKSLIP_KERNELS {

template <int... I>
struct LaneList {};
template <int N, int... I>
struct MakeLaneList : MakeLaneList<N - 1, N - 1, I...> {};
template <int... I>
struct MakeLaneList<0, I...> {
  using Type = LaneList<I...>;
};

/// a0 b0 a1 b1 ... from the lower (kHigh: upper) halves of a and b.
template <int kHigh, class T, int W, int... I>
STICKSLIP_INLINE Pack<T, W> interleave(Pack<T, W> a, Pack<T, W> b, LaneList<I...>) {
  return __builtin_shufflevector(a.v, b.v, (kHigh * W / 2 + I / 2 + (I % 2) * W)...);
}

/// Transposes W packs in place.
template <class T, int W>
STICKSLIP_INLINE void transpose_block(Pack<T, W> (&x)[W]) {
  using Lanes = typename MakeLaneList<W>::Type;
#pragma GCC unroll 4
  for (int round = 1; round < W; round *= 2) {
    Pack<T, W> y[W];
#pragma GCC unroll 16
    for (int i = 0; i < W / 2; ++i) {
      y[2 * i] = interleave<0>(x[i], x[i + W / 2], Lanes{});
      y[2 * i + 1] = interleave<1>(x[i], x[i + W / 2], Lanes{});
    }
#pragma GCC unroll 16
    for (int i = 0; i < W; ++i) x[i] = y[i];
  }
}

/// out[k] = numbers k of the rows `rows` (W) of an array (any, n). Up to W numbers behind the last
/// row are read (and not used): arrays are padded.
template <class S>
STICKSLIP_INLINE void load_rows(const Value<S>* array, const int* rows, int n, S* out) {
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    const Value<S>* row = array + long(rows[0]) * n;
    for (int k = 0; k < n; ++k) out[k] = row[k];
  } else {
    constexpr int W = ScalarTraits<S>::kWidth;
    for (int first = 0; first < n; first += W) {
      S block[W];
      for (int i = 0; i < W; ++i)
        __builtin_memcpy(&block[i], array + long(rows[i]) * n + first, sizeof(S));
      transpose_block(block);
      const int count = n - first < W ? n - first : W;
      for (int k = 0; k < count; ++k) out[first + k] = block[k];
    }
  }
}

/// The way back.
template <class S>
STICKSLIP_INLINE void store_rows(const S* in, int n, Value<S>* array, const int* rows) {
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    Value<S>* row = array + long(rows[0]) * n;
    for (int k = 0; k < n; ++k) row[k] = in[k];
  } else {
    constexpr int W = ScalarTraits<S>::kWidth;
    for (int first = 0; first < n; first += W) {
      const int count = n - first < W ? n - first : W;
      S block[W];
      for (int k = 0; k < W; ++k) block[k] = in[first + (k < count ? k : 0)];
      transpose_block(block);
      if (count == W) {
        for (int i = 0; i < W; ++i)
          __builtin_memcpy(array + long(rows[i]) * n + first, &block[i], sizeof(S));
      } else {
        for (int i = 0; i < W; ++i)
          __builtin_memcpy(array + long(rows[i]) * n + first, &block[i], count * sizeof(Value<S>));
      }
    }
  }
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
