// Shared dofs handled by one operation: four for a plain scalar, one for a pack.
#pragma once
#include "lane/row3.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

template <class S, bool kPlain = ScalarTraits<S>::kWidth == 1>
struct ChunkOf {
  using Type = S;
  static constexpr int kSize = 1;
};
template <class S>
struct ChunkOf<S, true> {
  using Type = Pack<S, 4>;
  static constexpr int kSize = 4;
};
template <class S>
using Chunk = typename ChunkOf<S>::Type;
template <class S>
inline constexpr int kChunk = ChunkOf<S>::kSize;

template <class S>
STICKSLIP_INLINE Chunk<S> load_chunk(const S* p) {
  Chunk<S> c;
  __builtin_memcpy(&c, p, sizeof c);
  return c;
}
template <class S>
STICKSLIP_INLINE void store_chunk(S* p, const Chunk<S>& c) {
  __builtin_memcpy(p, &c, sizeof c);
}
template <class S>
STICKSLIP_INLINE Chunk<S> madd_chunk(const Chunk<S>& a, S b, const Chunk<S>& c) {
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return madd(a, Chunk<S>(b), c);
  else
    return madd(a, b, c);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
