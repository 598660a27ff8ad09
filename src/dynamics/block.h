// Up to three neighboring joints of a chain, eliminated together: L is dense between them and six
// numbers per row outside, however deep the tree is (docs/theory/dynamics.md, section 4). Against
// joint by joint this shortens the chain of dependent operations to a third, and the inertia that
// is handed on is a rigid body's within the outermost block of a chain.
//
// Blocks are counted from the tip; the one at the chain's first joint may be smaller. Joint 0 of a
// block is the one nearest to the base.
#pragma once
#include "dynamics/tree.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

inline constexpr int kBlock = 3;

template <int N>
struct BlockSize {
  static constexpr int value = N;
};

/// f(first slot, BlockSize).
template <class F>
STICKSLIP_INLINE void with_block_size(int slot, int size, const F& f) {
  if (size == 3)
    f(slot, BlockSize<3>{});
  else if (size == 2)
    f(slot, BlockSize<2>{});
  else
    f(slot, BlockSize<1>{});
}

/// f(first slot, BlockSize) for the blocks of a chain, from the base to the tip.
template <class F>
STICKSLIP_INLINE void blocks_outward(const Bundle& b, const F& f) {
  const int end = b.first_slot + b.length;
  for (int slot = b.first_slot, size = (b.length - 1) % kBlock + 1; slot < end;
       slot += size, size = kBlock)
    with_block_size(slot, size, f);
}

/// f(first slot, BlockSize) for the block of a chain that ends before `slot`, which becomes the
/// block's first.
template <class F>
STICKSLIP_INLINE void next_block_inward(const Bundle& b, int& slot, const F& f) {
  const int left = slot - b.first_slot, size = left < kBlock ? left : kBlock;
  slot = slot - size;
  with_block_size(slot, size, f);
}

/// Diagonal of L from D and 1 / D, and the row U = F / sqrt(D). Returns 1 / sqrt(D).
template <class W>
STICKSLIP_INLINE W finish_row(W d, W inverse, LinkState<W>& link, Spatial<W>& u) {
  link.root = sqrt(d);
  link.inv_root = link.root * inverse;
  u = u * link.inv_root;
  store(u, link.arm);
  return link.inv_root;
}

/// Rows of L of the N joints at `slot` (D8), from the inertia of the last one's link and all that
/// hangs on it. Returns what is left for the parent (D7).
template <int N, class I, class S>
STICKSLIP_INLINE ArticulatedInertia<Wide<S>> factor_block(Tree<S>& t, int slot, I inertia,
                                                          const S* diagonal) {
  using W = Wide<S>;
  LinkState<W>* link = t.links + slot;
  // F = I^c s and M between the joints, as if nothing were free to move.
  const Spatial<W> s0 = link[0].axis;
  Spatial<W> u0, u1, u2;
  W m00, m10, m11, m20, m21, m22;
  if constexpr (N > 2) {
    const Spatial<W> s1 = link[1].axis, s2 = link[2].axis;
    u2 = inertia * s2;
    m22 = dot(u2, s2), m21 = dot(u2, s1), m20 = dot(u2, s0);
    inertia = inertia + at_reference(link[1].inertia);
  }
  if constexpr (N > 1) {
    const Spatial<W> s1 = link[1].axis;
    u1 = inertia * s1;
    m11 = dot(u1, s1), m10 = dot(u1, s0);
    inertia = inertia + at_reference(link[0].inertia);
  }
  u0 = inertia * s0;
  m00 = dot(u0, s0);
  if (diagonal) {
    m00 = m00 + load_lanes(diagonal, t.slots[slot].joint);
    if constexpr (N > 1) m11 = m11 + load_lanes(diagonal, t.slots[slot + 1].joint);
    if constexpr (N > 2) m22 = m22 + load_lanes(diagonal, t.slots[slot + 2].joint);
  }
  // M = L^T L from the last row, with the base columns F. The square roots stay off the chain from
  // one row to the next: only the divisions are on it.
  const W one = constant<W>(1);
  if constexpr (N > 2) {
    const W inverse = one / m22, by1 = m21 * inverse, by0 = m20 * inverse;
    m11 = nmadd(by1, m21, m11), m10 = nmadd(by1, m20, m10), m00 = nmadd(by0, m20, m00);
    u1 = nmadd(u2, by1, u1), u0 = nmadd(u2, by0, u0);
    const W scale = finish_row(m22, inverse, link[2], u2);
    link[2].inner[0] = m21 * scale, link[2].inner[1] = m20 * scale;
  }
  if constexpr (N > 1) {
    const W inverse = one / m11, by0 = m10 * inverse;
    m00 = nmadd(by0, m10, m00);
    u0 = nmadd(u1, by0, u0);
    link[1].inner[0] = m10 * finish_row(m11, inverse, link[1], u1);
  }
  finish_row(m00, one / m00, link[0], u0);
  const ArticulatedInertia<W> all = articulated(inertia);
  if constexpr (N == 1) return without(all, u0);
  if constexpr (N == 2) return without(all, u1, u0);
  if constexpr (N == 3) return without(all, u2, u1, u0);
}

/// x of the N joints at `slot`, times `scale`, from the force f on the last one's link and all that
/// hangs on it, its own apart (D11). f becomes what is passed on.
template <int N, class S>
STICKSLIP_INLINE void solve_transposed_block(Tree<S>& t, int slot, const S* tau, Wide<S> scale,
                                             Spatial<Wide<S>>& f) {
  using W = Wide<S>;
  LinkState<W>* link = t.links + slot;
  W x0, x1, x2;
  const auto on_joint = [&](int k) STICKSLIP_LAMBDA {
    f = f + link[k].force;
    const W along = dot(f, link[k].axis);
    return tau ? along + load_lanes(tau, t.slots[slot + k].joint) : along;
  };
  if constexpr (N > 2) x2 = on_joint(2);
  if constexpr (N > 1) x1 = on_joint(1);
  x0 = on_joint(0);
  if constexpr (N > 2) {
    x2 = x2 * link[2].inv_root;
    link[2].x = x2 * scale;
    x1 = nmadd(link[2].inner[0], x2, x1), x0 = nmadd(link[2].inner[1], x2, x0);
    f = nmadd(link[2].arm, x2, f);
  }
  if constexpr (N > 1) {
    x1 = x1 * link[1].inv_root;
    link[1].x = x1 * scale;
    x0 = nmadd(link[1].inner[0], x1, x0);
    f = nmadd(link[1].arm, x1, f);
  }
  x0 = x0 * link[0].inv_root;
  link[0].x = x0 * scale;
  f = nmadd(link[0].arm, x0, f);
}

/// Rates of the N joints at `slot` from x and the motion a of the parent (D12). Calls put(k, rate);
/// a becomes the motion of the last link.
template <int N, class W, class F>
STICKSLIP_INLINE void solve_block(const LinkState<W>* link, Spatial<W>& a, const F& put) {
  W r0, r1, r2;
  r0 = link[0].x - dot(link[0].arm, a);
  if constexpr (N > 1) r1 = link[1].x - dot(link[1].arm, a);
  if constexpr (N > 2) r2 = link[2].x - dot(link[2].arm, a);
  r0 = r0 * link[0].inv_root;
  put(0, r0);
  a = madd(link[0].axis, r0, a);
  if constexpr (N > 1) {
    r1 = nmadd(link[1].inner[0], r0, r1) * link[1].inv_root;
    put(1, r1);
    a = madd(link[1].axis, r1, a);
  }
  if constexpr (N > 2) {
    r2 = nmadd(link[2].inner[0], r1, nmadd(link[2].inner[1], r0, r2)) * link[2].inv_root;
    put(2, r2);
    a = madd(link[2].axis, r2, a);
  }
}

/// x = L u of the N joints at `slot`, v the motion of the parent (D13).
template <int N, class S>
STICKSLIP_INLINE void multiply_block(Tree<S>& t, int slot, const S* rates,
                                     const Spatial<Wide<S>>& v) {
  using W = Wide<S>;
  LinkState<W>* link = t.links + slot;
  const W r0 = load_lanes(rates, t.slots[slot].joint);
  link[0].x = madd(link[0].root, r0, dot(link[0].arm, v));
  if constexpr (N > 1) {
    const W r1 = load_lanes(rates, t.slots[slot + 1].joint);
    link[1].x = madd(link[1].root, r1, madd(link[1].inner[0], r0, dot(link[1].arm, v)));
    if constexpr (N > 2) {
      const W r2 = load_lanes(rates, t.slots[slot + 2].joint);
      link[2].x = madd(link[2].root, r2,
                       madd(link[2].inner[0], r1, madd(link[2].inner[1], r0, dot(link[2].arm, v))));
    }
  }
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
