// The linear system of a Newton step, (I + sum Y^T N Y) x = -sum Y^T g over the shared dofs
// (docs/theory/solvers.md (C33)).
//
// Elimination without pivoting, from the last dof to the first: a breakdown shows as a huge or
// non-finite x, which the caller rejects. Whatever the tiles and blocks below, each entry is summed
// over the contacts in their order, then over the bodies, and meets the pivots in theirs, so that a
// lane of a pack has the bits of the plain scalar, and of solve_fixed if it touches six dofs only.
#pragma once
#include "contact/factored_problem.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

template <class S>
STICKSLIP_INLINE S inverse_pivot(S d) {
  const S tiny = constant<S>(1e-30);
  return constant<S>(1) / select(abs(d) > tiny, d, tiny);
}

/// M dofs that every contact touches; the matrix stays in registers, row by row in chunks, the
/// right-hand side (in p.scratch, x too) in column M.
template <int M, class S>
STICKSLIP_STAGE S* solve_fixed(FactoredProblem<S>& p) {
  constexpr bool kPlain = ScalarTraits<S>::kWidth == 1;
  constexpr int K = kChunk<S>, kColumns = round_up(M, K) / K, kAll = round_up(M + 1, K) / K;
  constexpr int kGroup = kPlain ? 1 : 3;  // columns summed at once
  const S zero = constant<S>(0), one = constant<S>(1);
  S* x = p.scratch;
  Chunk<S> row[M][kAll];
  const auto at = [](const Chunk<S>* r, int k) {
    if constexpr (K > 1)
      return S(r[k / K].v[k % K]);
    else
      return r[k];
  };
  const auto put = [](Chunk<S>* r, int k, S v) {
    if constexpr (K > 1)
      r[k / K].v[k % K] = v;
    else
      r[k] = v;
  };
#pragma GCC unroll 8
  for (int first = 0; first < kColumns; first += kGroup) {
    Chunk<S> sum[M][kGroup];
#pragma GCC unroll 8
    for (int i = 0; i < M; ++i) {
#pragma GCC unroll 3
      for (int q = 0; q < kGroup; ++q) {
        sum[i][q] = Chunk<S>(zero);
        if (i / K == first + q) put(&sum[i][q], i % K, one);
      }
    }
    for (int k = 0; k < p.size(); ++k) {
      const FactoredContact<S>& c = p.contact(k);
      if (!kPlain && !c.moves) continue;
#pragma GCC unroll 3
      for (int r = 0; r < 3; ++r) {
        const S* t = reinterpret_cast<const S*>(c.yn + r * kColumns);
#pragma GCC unroll 8
        for (int i = 0; i < M; ++i)
#pragma GCC unroll 3
          for (int q = 0; q < kGroup; ++q)
            sum[i][q] = madd_chunk<S>(row_chunk<M>(c, r, first + q), t[i], sum[i][q]);
      }
    }
#pragma GCC unroll 8
    for (int i = 0; i < M; ++i)
#pragma GCC unroll 3
      for (int q = 0; q < kGroup; ++q) row[i][first + q] = sum[i][q];
  }
#pragma GCC unroll 8
  for (int i = 0; i < M; ++i) {
    if constexpr (kAll > kColumns) row[i][kAll - 1] = Chunk<S>(zero);
    put(row[i], M, x[i]);
  }
  S inverse[M];
#pragma GCC unroll 8
  for (int j = M - 1; j >= 0; --j) {
    inverse[j] = inverse_pivot(at(row[j], j));
#pragma GCC unroll 8
    for (int i = 0; i < j; ++i) {
      const S f = -(at(row[i], j) * inverse[j]);
      // What lies between the diagonal and the right-hand side is not used again.
#pragma GCC unroll 8
      for (int q = 0; q < kAll; ++q)
        if (q * K < j || q == M / K) row[i][q] = madd_chunk<S>(row[j][q], f, row[i][q]);
    }
  }
#pragma GCC unroll 8
  for (int i = 0; i < M; ++i) {
    S y = at(row[i], M);
#pragma GCC unroll 8
    for (int k = 0; k < i; ++k) y = nmadd(at(row[i], k), x[k], y);
    x[i] = y * inverse[i];
  }
  return x;
}

// ---- any number of dofs, a pack

template <int N>
struct Size {
  static constexpr int value = N;
};
/// f(first, Size) for runs of N, and of one for what is left of n.
template <int N, class F>
STICKSLIP_INLINE void in_runs(int n, const F& f) {
  int k = 0;
  for (; k + N <= n; k += N) f(k, Size<N>{});
  for (; k < n; ++k) f(k, Size<1>{});
}

/// Tiles that stay in registers.
inline constexpr int kTileRows = 3;
#ifdef __AVX512F__
inline constexpr int kTileColumns = 6;
#else
inline constexpr int kTileColumns = 3;
#endif

/// What a contact (three rows) or a body (six) brings to the matrix, over the dofs that it touches.
template <class S>
struct MatrixShare {
  const S* y;   // (dofs, rows)
  const S* yn;  // (rows, dofs): Y^T N
};

/// Adds Y^T N Y of n shares with the same `count` dofs to R rows and C columns of the matrix: those
/// of the dofs from the `row`-th and the `column`-th.
template <int kRows, int R, int C, class S, class ShareOf>
STICKSLIP_INLINE void add_tile(FactoredProblem<S>& p, const int* index, int count, int row,
                               int column, int n, const ShareOf& share_of) {
  S sum[R][C];
  const auto at = [&](int a, int b) STICKSLIP_LAMBDA {
    return p.matrix + index[row + a] * p.stride() + index[column + b];
  };
#pragma GCC unroll 3
  for (int a = 0; a < R; ++a)
#pragma GCC unroll 6
    for (int b = 0; b < C; ++b) sum[a][b] = *at(a, b);
  for (int i = 0; i < n; ++i) {
    const MatrixShare<S> share = share_of(i);
    if (!share.y) continue;
#pragma GCC unroll 6
    for (int r = 0; r < kRows; ++r) {
      const S *t = share.yn + r * count + row, *y = share.y + kRows * column + r;
#pragma GCC unroll 3
      for (int a = 0; a < R; ++a)
#pragma GCC unroll 6
        for (int b = 0; b < C; ++b) sum[a][b] = madd(y[kRows * b], t[a], sum[a][b]);
    }
  }
#pragma GCC unroll 3
  for (int a = 0; a < R; ++a)
#pragma GCC unroll 6
    for (int b = 0; b < C; ++b) *at(a, b) = sum[a][b];
}

template <int kRows, class S, class ShareOf>
STICKSLIP_INLINE void add_shares(FactoredProblem<S>& p, const int* index, int count, int n,
                                 const ShareOf& share_of) {
  in_runs<kTileRows>(count, [&](int row, auto rows) STICKSLIP_LAMBDA {
    in_runs<kTileColumns>(count, [&](int column, auto columns) STICKSLIP_LAMBDA {
      add_tile<kRows, decltype(rows)::value, decltype(columns)::value>(p, index, count, row, column,
                                                                       n, share_of);
    });
  });
}

template <class S>
bool touch_the_same(const FactoredContact<S>& a, const FactoredContact<S>& b) {
  if (a.count != b.count) return false;
  for (int k = 0; k < a.count; ++k)
    if (a.index[k] != b.index[k]) return false;
  return true;
}

template <class S>
STICKSLIP_STAGE void sum_matrix(FactoredProblem<S>& p) {
  const S zero = constant<S>(0);
  const int stride = p.stride();
  for (int j = 0; j < p.dofs(); ++j) {
    if (!p.coupling.touched(j)) continue;
    for (int k = 0; k < p.coupling.count(j); ++k) {
      const int i = p.coupling.list(j)[k];
      p.matrix[i * stride + j] = p.matrix[j * stride + i] = zero;
    }
    p.matrix[j * stride + j] = constant<S>(1);
  }
  for (int first = 0, end; first < p.size(); first = end) {
    end = first + 1;
    if (!p.contact(first).alone) continue;
    while (end < p.size() && touch_the_same(p.contact(first), p.contact(end))) ++end;
    const auto share_of = [&](int i) STICKSLIP_LAMBDA -> MatrixShare<S> {
      const FactoredContact<S>& c = p.contact(first + i);
      return {c.alone ? reinterpret_cast<const S*>(c.y) : nullptr, c.yn};
    };
    const FactoredContact<S>& c = p.contact(first);
    add_shares<3>(p, c.index, c.count, end - first, share_of);
  }
}

/// The same of the bodies.
template <class S>
STICKSLIP_STAGE void add_bodies(FactoredProblem<S>& p) {
  for (int i = 0; i < p.num_bodies(); ++i) {
    const ContactBody<S>& b = p.body(i);
    if (!b.moves) continue;
    add_shares<6>(p, b.left(), b.left_count(), 1, [&](int) STICKSLIP_LAMBDA -> MatrixShare<S> {
      return {b.left_columns(), b.response_rows};
    });
  }
}

/// Row `to` loses its entry in the pivot's column: to += f pivot, in the pivot's columns of `list`.
template <class S>
STICKSLIP_INLINE void clear_entry(S* to, const S* pivot, S f, const int* list, int count) {
  for (int k = 0; k < count; ++k) to[list[k]] = madd(pivot[list[k]], f, to[list[k]]);
}

/// Eliminates dof j, whose inverse pivot takes the place of the pivot.
template <class S>
STICKSLIP_INLINE void eliminate_one(FactoredProblem<S>& p, int j) {
  const int stride = p.stride(), *list = p.coupling.list(j), count = p.coupling.count(j);
  S *h = p.matrix, *x = p.scratch, *pivot = h + j * stride;
  pivot[j] = inverse_pivot(pivot[j]);
  for (int k = 0; k < count; ++k) {
    S* to = h + list[k] * stride;
    const S f = -(to[j] * pivot[j]);
    clear_entry(to, pivot, f, list, count);
    x[list[k]] = madd(x[j], f, x[list[k]]);
  }
}

/// Eliminates j, j - 1 and j - 2, which couple with the same dofs: one pass over what is left.
template <class S>
STICKSLIP_INLINE void eliminate_three(FactoredProblem<S>& p, int j) {
  const int stride = p.stride(), *list = p.coupling.list(j - 2), count = p.coupling.count(j - 2);
  S *h = p.matrix, *x = p.scratch;
  S *a = h + j * stride, *b = a - stride, *c = b - stride;
  const S xa = x[j];
  a[j] = inverse_pivot(a[j]);
  const S fb = -(b[j] * a[j]), fc = -(c[j] * a[j]);
  b[j - 1] = inverse_pivot(madd(a[j - 1], fb, b[j - 1]));
  b[j - 2] = madd(a[j - 2], fb, b[j - 2]);
  const S xb = x[j - 1] = madd(xa, fb, x[j - 1]);
  const S gc = -(madd(a[j - 1], fc, c[j - 1]) * b[j - 1]);
  c[j - 2] = inverse_pivot(madd(b[j - 2], gc, madd(a[j - 2], fc, c[j - 2])));
  const S xc = x[j - 2] = madd(xb, gc, madd(xa, fc, x[j - 2]));
  for (int k = 0; k < count; ++k) {
    const int i = list[k];
    b[i] = madd(a[i], fb, b[i]);
    c[i] = madd(b[i], gc, madd(a[i], fc, c[i]));
  }
  // Two rows at once share the loads of the pivots'.
  in_runs<2>(count, [&](int first, auto rows) STICKSLIP_LAMBDA {
    constexpr int R = decltype(rows)::value;
    S *to[R], ta[R], tb[R], tc[R];
#pragma GCC unroll 2
    for (int r = 0; r < R; ++r) {
      to[r] = h + list[first + r] * stride;
      ta[r] = -(to[r][j] * a[j]);
      tb[r] = -(madd(a[j - 1], ta[r], to[r][j - 1]) * b[j - 1]);
      tc[r] = -(madd(b[j - 2], tb[r], madd(a[j - 2], ta[r], to[r][j - 2])) * c[j - 2]);
      S& y = x[list[first + r]];
      y = madd(xc, tc[r], madd(xb, tb[r], madd(xa, ta[r], y)));
    }
    for (int l = 0; l < count; ++l) {
      const int i = list[l];
      const S pa = a[i], pb = b[i], pc = c[i];
#pragma GCC unroll 2
      for (int r = 0; r < R; ++r)
        to[r][i] = madd(pc, tc[r], madd(pb, tb[r], madd(pa, ta[r], to[r][i])));
    }
  });
}

template <class S>
STICKSLIP_STAGE void eliminate_dofs(FactoredProblem<S>& p) {
  for (int j = p.dofs() - 1; j >= 0;) {
    const bool three = p.coupling.three(j);
    if (three)
      eliminate_three(p, j);
    else if (p.coupling.touched(j))
      eliminate_one(p, j);
    j -= three ? 3 : 1;
  }
}

// ---- any number of dofs, a plain scalar

/// Adds Y^T N Y of a contact (three rows) or a body (six): y (chunks, rows), yn (rows, chunks).
template <int kRows, class S>
STICKSLIP_INLINE void add_share_by_chunks(FactoredProblem<S>& p, const int* index, int count,
                                          const int* start, int chunks, const Chunk<S>* y,
                                          const Chunk<S>* yn) {
  for (int j = 0, k = 0; j < chunks; ++j)
    for (; k < count && index[k] < start[j] + kChunk<S>; ++k) {
      S t[kRows];
      for (int r = 0; r < kRows; ++r)
        t[r] = reinterpret_cast<const S*>(yn + r * chunks + j)[index[k] - start[j]];
      S* row = p.matrix + index[k] * p.stride();
      for (int q = 0; q < chunks; ++q) {
        Chunk<S> v = load_chunk(row + start[q]);
        for (int r = 0; r < kRows; ++r) v = madd_chunk<S>(y[kRows * q + r], t[r], v);
        store_chunk(row + start[q], v);
      }
    }
}

template <class S>
STICKSLIP_STAGE void sum_matrix_by_chunks(FactoredProblem<S>& p) {
  const int m = p.dofs(), stride = p.stride();
  S* h = p.matrix;
  for (int k = 0; k < m * stride; ++k) h[k] = constant<S>(0);
  for (int j = 0; j < m; ++j) h[j * stride + j] = constant<S>(1);
  for (int i = 0; i < p.size(); ++i) {
    const FactoredContact<S>& c = p.contact(i);
    if (c.alone) add_share_by_chunks<3>(p, c.index, c.count, c.chunk_start, c.chunks, c.yt, c.yn);
  }
}

template <class S>
STICKSLIP_STAGE void add_bodies_by_chunks(FactoredProblem<S>& p) {
  for (int i = 0; i < p.num_bodies(); ++i) {
    const ContactBody<S>& b = p.body(i);
    add_share_by_chunks<6>(p, b.left(), b.left_count(), b.chunk_start(), b.chunks(),
                           b.left_columns(), b.response_rows);
  }
}

template <class S>
STICKSLIP_STAGE void eliminate_dofs_by_chunks(FactoredProblem<S>& p) {
  constexpr int K = kChunk<S>;
  const int stride = p.stride();
  S *h = p.matrix, *x = p.scratch;
  for (int j = p.dofs() - 1; j >= 0; --j) {
    if (!p.coupling.touched(j)) continue;
    S* pivot = h + j * stride;
    pivot[j] = inverse_pivot(pivot[j]);
    for (int k = 0; k < p.coupling.count(j); ++k) {
      const int i = p.coupling.list(j)[k];
      S* row = h + i * stride;
      const S f = -(row[j] * pivot[j]);
      // Past the diagonal nothing is used again.
      for (int q = 0; q < j; q += K)
        store_chunk(row + q, madd_chunk<S>(load_chunk(pivot + q), f, load_chunk(row + q)));
      x[i] = madd(x[j], f, x[i]);
    }
  }
}

// ---- both

/// Forward substitution: each row with the dofs before it.
template <class S>
STICKSLIP_STAGE void substitute(FactoredProblem<S>& p) {
  S* x = p.scratch;
  for (int j = 0; j < p.dofs(); ++j) {
    if (!p.coupling.touched(j)) continue;
    const S* row = p.matrix + j * p.stride();
    const int* list = p.coupling.list(j);
    S y = x[j];
    for (int k = 0; k < p.coupling.count(j); ++k) y = nmadd(row[list[k]], x[list[k]], y);
    x[j] = y * row[j];
  }
}

/// `by_bodies`: the contacts that are not `alone` are there as their bodies.
template <class S>
S* solve_any(FactoredProblem<S>& p, bool by_bodies = false) {
  by_bodies ? p.couple_bodies() : p.couple_contacts();
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    sum_matrix_by_chunks(p);
    if (by_bodies) add_bodies_by_chunks(p);
    eliminate_dofs_by_chunks(p);
  } else {
    sum_matrix(p);
    if (by_bodies) add_bodies(p);
    eliminate_dofs(p);
  }
  substitute(p);
  return p.scratch;
}

template <int M, class S>
STICKSLIP_INLINE S* solve_shared(FactoredProblem<S>& p) {
  if constexpr (M > 0)
    return solve_fixed<M>(p);
  else
    return solve_any(p);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
