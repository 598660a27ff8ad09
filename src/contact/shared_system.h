// The linear system of a Newton step, (I + sum Y^T N Y) x = -sum Y^T g over the shared dofs
// (docs/theory/solvers.md (C33)).
//
// Elimination without pivoting, from the last dof to the first: a breakdown shows as a huge or
// non-finite x, which the caller rejects. Whatever the tiles and blocks below, each entry is summed
// over the contacts in their order and meets the pivots in theirs, so that a lane of a pack has the
// bits of the plain scalar, and of solve_fixed if it touches six dofs only.
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

/// Adds Y^T N Y of the contacts [first, end), which touch the same dofs, to R rows and C columns of
/// the matrix: those of the dofs from the `row`-th and the `column`-th that they touch.
template <int R, int C, class S>
STICKSLIP_INLINE void add_tile(FactoredProblem<S>& p, int first, int end, int row, int column) {
  const int *index = p.contact(first).index, count = p.contact(first).count;
  S sum[R][C];
  const auto at = [&](int a, int b) STICKSLIP_LAMBDA {
    return p.matrix + index[row + a] * p.stride() + index[column + b];
  };
#pragma GCC unroll 3
  for (int a = 0; a < R; ++a)
#pragma GCC unroll 6
    for (int b = 0; b < C; ++b) sum[a][b] = *at(a, b);
  for (int i = first; i < end; ++i) {
    const FactoredContact<S>& c = p.contact(i);
    if (!c.moves) continue;
#pragma GCC unroll 3
    for (int r = 0; r < 3; ++r) {
      const S* t = c.yn + r * count + row;
#pragma GCC unroll 3
      for (int a = 0; a < R; ++a)
#pragma GCC unroll 6
        for (int b = 0; b < C; ++b)
          sum[a][b] = madd(row_chunk<0>(c, r, column + b), t[a], sum[a][b]);
    }
  }
#pragma GCC unroll 3
  for (int a = 0; a < R; ++a)
#pragma GCC unroll 6
    for (int b = 0; b < C; ++b) *at(a, b) = sum[a][b];
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
    for (int k = 0; k < p.coupling.count(j); ++k) {
      const int i = p.coupling.list(j)[k];
      p.matrix[i * stride + j] = p.matrix[j * stride + i] = zero;
    }
    p.matrix[j * stride + j] = constant<S>(1);
  }
  for (int first = 0, end; first < p.size(); first = end) {
    bool moves = p.contact(first).moves;
    for (end = first + 1; end < p.size(); ++end) {
      if (!touch_the_same(p.contact(first), p.contact(end))) break;
      moves = moves || p.contact(end).moves;
    }
    if (!moves) continue;
    const int count = p.contact(first).count;
    in_runs<kTileRows>(count, [&](int row, auto rows) STICKSLIP_LAMBDA {
      in_runs<kTileColumns>(count, [&](int column, auto columns) STICKSLIP_LAMBDA {
        add_tile<decltype(rows)::value, decltype(columns)::value>(p, first, end, row, column);
      });
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
    if (p.coupling.three(j)) {
      eliminate_three(p, j);
      j -= 3;
    } else {
      eliminate_one(p, j);
      j -= 1;
    }
  }
}

// ---- any number of dofs, a plain scalar

template <class S>
STICKSLIP_STAGE void sum_matrix_by_chunks(FactoredProblem<S>& p) {
  constexpr int K = kChunk<S>;
  const int m = p.dofs(), stride = p.stride();
  S* h = p.matrix;
  for (int k = 0; k < m * stride; ++k) h[k] = constant<S>(0);
  for (int j = 0; j < m; ++j) h[j * stride + j] = constant<S>(1);
  for (int i = 0; i < p.size(); ++i) {
    const FactoredContact<S>& c = p.contact(i);
    const int chunks = chunk_count<0>(c);
    for (int j = 0, k = 0; j < chunks; ++j)
      for (; k < c.count && c.index[k] < first_dof<0>(c, j) + K; ++k) {
        const int lane = c.index[k] - first_dof<0>(c, j);
        S t[3];
        for (int r = 0; r < 3; ++r) t[r] = reinterpret_cast<const S*>(c.yn + r * chunks + j)[lane];
        S* row = h + c.index[k] * stride;
        for (int q = 0; q < chunks; ++q) {
          S* to = row + first_dof<0>(c, q);
          Chunk<S> v = load_chunk(to);
          for (int r = 0; r < 3; ++r) v = madd_chunk<S>(row_chunk<0>(c, r, q), t[r], v);
          store_chunk(to, v);
        }
      }
  }
}

template <class S>
STICKSLIP_STAGE void eliminate_dofs_by_chunks(FactoredProblem<S>& p) {
  constexpr int K = kChunk<S>;
  const int stride = p.stride();
  S *h = p.matrix, *x = p.scratch;
  for (int j = p.dofs() - 1; j >= 0; --j) {
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
    const S* row = p.matrix + j * p.stride();
    const int* list = p.coupling.list(j);
    S y = x[j];
    for (int k = 0; k < p.coupling.count(j); ++k) y = nmadd(row[list[k]], x[list[k]], y);
    x[j] = y * row[j];
  }
}

template <class S>
S* solve_any(FactoredProblem<S>& p) {
  p.find_coupling();
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    sum_matrix_by_chunks(p);
    eliminate_dofs_by_chunks(p);
  } else {
    sum_matrix(p);
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
