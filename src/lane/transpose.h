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

/// Where the block of W numbers that begins at `first` of a row lies: the last one ends with the
/// row, so that some numbers are turned twice and none beside the row is touched, which may be
/// another thread's.
STICKSLIP_INLINE int block_start(int first, int n, int width) {
  return first + width <= n ? first : n - width;
}

/// Number k of W rows of n numbers.
template <class S, int... I>
STICKSLIP_INLINE S column(const Value<S>* array, const int* rows, int n, int k, LaneList<I...>) {
  return typename S::Vector{array[long(rows[I]) * n + k]...};
}

/// out[k] = numbers k of the rows `rows` (W) of an array (any, n).
template <class S>
STICKSLIP_INLINE void load_rows(const Value<S>* array, const int* rows, int n, S* out) {
  constexpr int W = ScalarTraits<S>::kWidth;
  if constexpr (W == 1) {
    for (int k = 0; k < n; ++k) out[k] = array[long(rows[0]) * n + k];
  } else if (n < W) {
    for (int k = 0; k < n; ++k)
      out[k] = column<S>(array, rows, n, k, typename MakeLaneList<W>::Type{});
  } else {
    for (int first = 0; first < n; first += W) {
      const int start = block_start(first, n, W);
      S block[W];
      for (int i = 0; i < W; ++i)
        __builtin_memcpy(&block[i], array + long(rows[i]) * n + start, sizeof(S));
      transpose_block(block);
      for (int k = 0; k < W; ++k) out[start + k] = block[k];
    }
  }
}

/// The way back.
template <class S>
STICKSLIP_INLINE void store_rows(const S* in, int n, Value<S>* array, const int* rows) {
  constexpr int W = ScalarTraits<S>::kWidth;
  if constexpr (W == 1) {
    for (int k = 0; k < n; ++k) array[long(rows[0]) * n + k] = in[k];
  } else if (n < W) {
    for (int i = 0; i < W; ++i)
      for (int k = 0; k < n; ++k) array[long(rows[i]) * n + k] = get_lane(in[k], i);
  } else {
    for (int first = 0; first < n; first += W) {
      const int start = block_start(first, n, W);
      S block[W];
      for (int k = 0; k < W; ++k) block[k] = in[start + k];
      transpose_block(block);
      for (int i = 0; i < W; ++i)
        __builtin_memcpy(array + long(rows[i]) * n + start, &block[i], sizeof(S));
    }
  }
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
