// Dense systems of robot size (up to some hundred rows), row-major, with partial pivoting, in
// place, without allocation: LU factors for several right-hand sides, and one elimination for a
// single one (docs/theory/solvers.md (C28)).
#pragma once
#include "lane/pack.h"

namespace stickslip::solvers {

/// The row at or below j with the largest entry in column j.
inline int pivot_row(const double* a, int m, int stride, int j) {
  int p = j;
  double most = abs(a[long(j) * stride + j]);
  for (int i = j + 1; i < m; ++i)
    if (const double x = abs(a[long(i) * stride + j]); x > most) most = x, p = i;
  return p;
}

/// Numbers handled at once along a row; rows of `eliminate` are padded to whole chunks.
inline constexpr int kRowChunk = 4;
constexpr int padded_row(int columns) { return (columns + kRowChunk - 1) / kRowChunk * kRowChunk; }

inline Pack<double, kRowChunk> load_row(const double* from) {
  Pack<double, kRowChunk> c;
  __builtin_memcpy(&c, from, sizeof c);
  return c;
}
inline void store_row(double* to, const Pack<double, kRowChunk>& c) {
  __builtin_memcpy(to, &c, sizeof c);
}

/// x with A x = b, for the (m, m + 1) matrix [A, b] with rows `stride` = padded_row(m + 1) apart,
/// which it destroys. Columns left of the pivot are dead, so every update may start at a whole
/// chunk. A column without a pivot gets a tiny one: x is then huge or not finite, and the caller
/// rejects it.
inline void eliminate(double* a, int m, int stride, double* x) {
  using Chunk = Pack<double, kRowChunk>;
  for (int j = 0; j < m; ++j) {
    double* top = a + long(j) * stride;
    const int first = j / kRowChunk * kRowChunk;
    if (const int p = pivot_row(a, m, stride, j); p != j) {
      double* other = a + long(p) * stride;
      for (int k = first; k <= m; k += kRowChunk) {
        const Chunk t = load_row(top + k);
        store_row(top + k, load_row(other + k));
        store_row(other + k, t);
      }
    }
    if (!(abs(top[j]) > 1e-300)) top[j] = 1e-300;
    const double inverse = 1 / top[j];
    const int next = (j + 1) / kRowChunk * kRowChunk;
    for (int i = j + 1; i < m; ++i) {
      double* row = a + long(i) * stride;
      const Chunk f(-(row[j] * inverse));
      for (int k = next; k <= m; k += kRowChunk)
        store_row(row + k, madd(load_row(top + k), f, load_row(row + k)));
    }
  }
  for (int i = m - 1; i >= 0; --i) {
    x[i] = a[long(i) * stride + m] / a[long(i) * stride + i];
    for (int k = 0; k < i; ++k)
      a[long(k) * stride + m] = nmadd(a[long(k) * stride + i], x[i], a[long(k) * stride + m]);
  }
}

/// P A = L U of the (m, m) matrix `a` with rows `stride` apart; row j was swapped with pivot[j].
/// A column without a pivot keeps a tiny one: the solution is then huge, and the caller rejects it.
inline void factor_lu(double* a, int m, int stride, int* pivot) {
  for (int j = 0; j < m; ++j) {
    const int p = pivot_row(a, m, stride, j);
    pivot[j] = p;
    double* __restrict__ top = a + long(j) * stride;
    if (p != j) {
      double* other = a + long(p) * stride;
      for (int k = 0; k < m; ++k) {
        const double t = top[k];
        top[k] = other[k];
        other[k] = t;
      }
    }
    if (!(abs(top[j]) > 1e-300)) top[j] = 1e-300;
    const double inverse = 1 / top[j];
    for (int i = j + 1; i < m; ++i) {
      double* __restrict__ row = a + long(i) * stride;
      if (row[j] == 0) continue;
      const double f = row[j] * inverse;
      row[j] = f;
      for (int k = j + 1; k < m; ++k) row[k] = nmadd(f, top[k], row[k]);
    }
  }
}

/// x <- A^-1 x from the factors.
inline void solve_lu(const double* a, int m, int stride, const int* pivot, double* x) {
  for (int j = 0; j < m; ++j) {
    const double t = x[pivot[j]];
    x[pivot[j]] = x[j];
    x[j] = t;
  }
  for (int i = 1; i < m; ++i) {
    const double* row = a + long(i) * stride;
    double sum = x[i];
    for (int k = 0; k < i; ++k) sum = nmadd(row[k], x[k], sum);
    x[i] = sum;
  }
  for (int i = m - 1; i >= 0; --i) {
    const double* row = a + long(i) * stride;
    double sum = x[i];
    for (int k = i + 1; k < m; ++k) sum = nmadd(row[k], x[k], sum);
    x[i] = sum / row[i];
  }
}

}  // namespace stickslip::solvers
