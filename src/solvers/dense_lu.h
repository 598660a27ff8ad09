// LU factors with partial pivoting, in place, for systems of robot size (up to some hundred rows): no
// allocation, rows contiguous, so that the compiler's vectors reach along them.
#pragma once
#include "lane/lane.h"

namespace stickslip::solvers {

/// P A = L U of the (m, m) matrix `a` with rows `stride` apart; row j was swapped with pivot[j].
/// A column without a pivot keeps a tiny one: the solution is then huge, and the caller rejects it.
inline void factor_lu(double* a, int m, int stride, int* pivot) {
  for (int j = 0; j < m; ++j) {
    int p = j;
    for (int i = j + 1; i < m; ++i)
      if (abs(a[long(i) * stride + j]) > abs(a[long(p) * stride + j])) p = i;
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
