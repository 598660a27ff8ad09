// Block Gauss-Seidel over a factored problem: one visit solves one contact with the others held
// ([Hwangbo 2018] Algorithm 2 with alpha = 1), in the space of the shared dofs
// (docs/theory/solvers.md (C20)-(C24)).
//
//   c = c0 + Y w - (Y Y^T) lambda;   lambda' = local(c);   w += Y^T (lambda' - lambda)
// A visit costs 45 multiplications however many contacts there are; the slip solve takes one Halley
// step from the last direction, since the sweep will come back. What bounds the speed of one robot
// is the latency of the chain w -> c -> lambda -> w, so everything that does not lie on it (the
// base velocity, the basis of the slip step) is kept ready.
#pragma once
#include "contact/factored_problem.h"
#include "contact/halley.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Rows of three to three rows: out[r] holds entry r of the four columns.
template <class V>
STICKSLIP_INLINE void transpose_columns(V a, V b, V c, V d, V out[3]) {
  const V ab = __builtin_shufflevector(a, b, 0, 4, 2, 6),
          cd = __builtin_shufflevector(c, d, 0, 4, 2, 6);
  out[0] = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
  out[1] = __builtin_shufflevector(__builtin_shufflevector(a, b, 1, 5, 3, 7),
                                   __builtin_shufflevector(c, d, 1, 5, 3, 7), 0, 1, 4, 5);
  out[2] = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

/// Transposed rows in chunks, from the rows; a pack needs none.
template <int M, class S>
STICKSLIP_INLINE void transpose_rows(FactoredContact<S>& c) {
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    using V = typename Chunk<S>::Vector;
    const V none = {};
    const int n = M == 6 ? 6 : c.count;
    int chunks = 0;
    for (int k = 0; k < n; ++chunks) {
      const int first = M == 6 ? 4 * chunks : c.index[k];
      const V* column[4];
      // By choice of an address, not by a branch: where a leg's dofs lie in the chunks of a contact
      // is hard to predict.
#pragma GCC unroll 4
      for (int i = 0; i < 4; ++i) {
        const bool has = k < n && (M == 6 || c.index[k] == first + i);
        column[i] = has ? &c.y[k].v.v : &none;
        k += has;
      }
      if (M == 0) c.chunk_start[chunks] = first;
      V row[3];
      transpose_columns(*column[0], *column[1], *column[2], *column[3], row);
      for (int r = 0; r < 3; ++r) c.yt[3 * chunks + r] = row[r];
    }
    c.chunks = chunks;
  }
}

/// In lanes that do not have the contact it is replaced by one that is always open and moves
/// nothing.
template <int M, class S>
STICKSLIP_INLINE void clear_inactive(FactoredContact<S>& c) {
  if (all(c.active)) return;
  // Not zero, so that it counts as opening; too small to show in a tolerance.
  const S zero = constant<S>(0), one = constant<S>(1), tiny = constant<S>(1e-30);
  for (int k = 0; k < (M == 6 ? 6 : c.count); ++k) c.y[k] = row_where(c.active, c.y[k]);
  for (int i = 0; i < 6; ++i)
    c.private_block[i] =
        select(c.active, c.private_block[i], i == 0 || i == 3 || i == 5 ? one : zero);
  for (int r = 0; r < 3; ++r) {
    c.offset[r] = select(c.active, c.offset[r], r == 2 ? tiny : zero);
    c.impulse[r] = select(c.active, c.impulse[r], zero);
  }
  c.friction = select(c.active, c.friction, zero);
}

/// Y Y^T.
template <int M, class S>
STICKSLIP_INLINE Symmetric3<S> gram(const FactoredContact<S>& c) {
  Symmetric3<S> g = zero_symmetric<S>();
  for (int k = 0; k < (M == 6 ? 6 : c.count); ++k) g.add_square(c.y[k]);
  return g;
}

/// Blocks of one contact from its rows, and its warm start (brought back into the cone).
template <int M, class S>
STICKSLIP_STAGE void prepare_contact(FactoredContact<S>& c) {
  const S zero = constant<S>(0), one = constant<S>(1);
  clear_inactive<M>(c);
  transpose_rows<M>(c);
  c.shared = gram<M>(c);
  S shared[6];
  c.shared.store_to(shared);
  LocalContact<S>& k = c.local;
  const S* p = c.private_block;
  k.xx = shared[0] + p[0], k.xy = shared[1] + p[1], k.xz = shared[2] + p[2];
  k.yy = shared[3] + p[3], k.yz = shared[4] + p[4], k.zz = shared[5] + p[5];
  k.mu = min(c.friction, constant<S>(kMaxFriction));
  prepare(k);
  // G^-1 = [S^-1, -S^-1 w; ., 1/G_zz + w^T S^-1 w]: one product of columns on the latency chain of
  // a sticking visit.
  const S ux = madd(k.ixx, k.wx, k.ixy * k.wy), uy = madd(k.ixy, k.wx, k.iyy * k.wy);
  c.inverse =
      make_symmetric(k.ixx, k.ixy, -ux, k.iyy, -uy, madd(k.wx, ux, madd(k.wy, uy, k.inv_zz)));
  // Warm start.
  S* l = c.impulse;
  l[2] = max(l[2], zero);
  const S limit = k.mu * l[2], square = madd(l[0], l[0], l[1] * l[1]);
  const auto outside = square > limit * limit;
  if (any(outside)) {
    const S f = select(outside, limit / sqrt(select(outside, square, one)), one);
    l[0] = l[0] * f, l[1] = l[1] * f;
  }
  c.lambda = make_row3(l[0], l[1], l[2]);
  reset_direction(c, l);
  update_base(c, l);
}

/// Visits one contact; only lanes in `live` change. Returns the squared velocity change,
/// |dlambda|^2 (trace G_ii / 3)^2.
template <int M, bool kMaxDissipation, class S>
STICKSLIP_INLINE S visit(FactoredContact<S>& c, S* w, Mask<S> live, S speed) {
  const S zero = constant<S>(0);
  const LocalContact<S>& k = c.local;
  const Row3<S> velocity = add_rows<M>(c, w, c.base);
  S v[3], old[3];
  store(velocity, v);
  store(c.lambda, old);
  const auto closing = (v[2] < zero) & (k.inv_zz > zero);
  if (!any(live & (closing | (old[2] > zero)))) return zero;
  S next[3];
  if (any(closing)) {
    Row3<S> stop = c.inverse.column(0) * v[0];
    stop = madd(c.inverse.column(1), v[1], stop);
    stop = madd(c.inverse.column(2), v[2], stop);
    store(stop, next);
    for (int r = 0; r < 3; ++r) next[r] = -next[r];
    Reduced<S> r;
    r.x = next[0], r.y = next[1], r.z = next[2];
    const S limit = k.mu * r.z;
    const auto inside = (r.z >= zero) & (madd(r.x, r.x, r.y * r.y) <= limit * limit);
    r.stick = closing & inside;
    r.slip = closing & !inside & live;
    if (any(r.slip)) {
      r.a = -v[2] * k.inv_zz;
      r.bx = madd(k.xz, r.a, v[0]);
      r.by = madd(k.yz, r.a, v[1]);
      visit_slip<kMaxDissipation>(k, r, speed, c.direction, next);
    }
    for (int i = 0; i < 3; ++i) next[i] = select(closing, next[i], zero);
  } else {
    for (int i = 0; i < 3; ++i) next[i] = zero;
  }
  S d[3];
  for (int i = 0; i < 3; ++i) {
    next[i] = select(live, next[i], old[i]);
    d[i] = next[i] - old[i];
  }
  add_transposed<M>(c, d, w);
  c.lambda = make_row3(next[0], next[1], next[2]);
  update_base(c, next);
  return madd(d[0], d[0], madd(d[1], d[1], d[2] * d[2])) * (k.scale * k.scale);
}

/// One sweep over all contacts in their order; the largest squared velocity change per lane
/// [m^2/s^2].
template <int M, bool kMaxDissipation, class S>
STICKSLIP_STAGE S sweep(FactoredProblem<S>& p, Mask<S> live, S speed) {
  S change = constant<S>(0);
  for (int i = 0; i < p.size(); ++i) {
    FactoredContact<S>& c = p.contact(i);
    // A slot that no live lane uses.
    if (ScalarTraits<S>::kWidth > 1 && !any(live & c.active)) continue;
    change = max(change, visit<M, kMaxDissipation>(c, p.w, live, speed));
  }
  return change;
}

/// w = w0 + sum Y^T lambda.
template <int M, class S>
STICKSLIP_STAGE void accumulate(FactoredProblem<S>& p) {
  S own[FactoredProblem<S>::padded(M)];  // nobody else's, so that six stay in registers
  S* w = M > 0 ? own : p.w;
  const int end = M > 0 ? FactoredProblem<S>::padded(M) : p.stride();
  for (int k = 0; k < end; k += kChunk<S>) store_chunk(w + k, load_chunk(p.w0 + k));
  for (int i = 0; i < p.size(); ++i) {
    S l[3];
    store(p.contact(i).lambda, l);
    add_transposed<M>(p.contact(i), l, w);
  }
  if (M > 0)
    for (int k = 0; k < end; k += kChunk<S>) store_chunk(p.w + k, load_chunk(w + k));
}

/// Puts impulses in place without touching w (`accumulate` follows).
template <class S>
STICKSLIP_INLINE void set_impulse(FactoredContact<S>& c, const S l[3]) {
  c.lambda = make_row3(l[0], l[1], l[2]);
  update_base(c, l);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
