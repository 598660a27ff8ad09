#include "contact/dense_factor.h"

#include <cmath>
#include <numeric>

namespace stickslip::contact {

DenseFactor factor_dense(const double* G, int size) {
  DenseFactor f;
  f.size = size;
  const std::size_t m = size;
  std::vector<double> rest(G, G + m * m), columns;  // columns of Y, one after the other
  double largest = 0;
  for (std::size_t i = 0; i < m; ++i) largest = std::fmax(largest, rest[i * m + i]);
  std::vector<char> done(m, 0);
  for (; f.rank < size; ++f.rank) {
    std::size_t pivot = m;
    double best = 1e-14 * largest;
    for (std::size_t i = 0; i < m; ++i)
      if (!done[i] && rest[i * m + i] > best) best = rest[i * m + i], pivot = i;
    if (pivot == m) break;
    // A semidefinite rest has no entry above its largest diagonal one: what is left is rounding of
    // the input.
    double beside = 0;
    for (std::size_t i = 0; i < m; ++i)
      if (!done[i]) beside = std::fmax(beside, std::fabs(rest[i * m + pivot]));
    if (beside > 2 * best) break;
    done[pivot] = 1;
    columns.resize((f.rank + 1) * m, 0);
    double* column = columns.data() + f.rank * m;
    const double inverse = 1 / std::sqrt(best);
    // What is eliminated already has no part in this column.
    for (std::size_t i = 0; i < m; ++i)
      column[i] = done[i] && i != pivot ? 0 : rest[i * m + pivot] * inverse;
    for (std::size_t i = 0; i < m; ++i)
      if (!done[i] && column[i] != 0)
        for (std::size_t j = 0; j < m; ++j) rest[i * m + j] -= column[i] * column[j];
  }
  // A semidefinite rest with zero diagonal is zero.
  double worst = 1e-6 * largest;
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; !done[i] && j < m; ++j)
      if (!done[j] && std::fabs(rest[i * m + j]) > worst)
        worst = std::fabs(rest[i * m + j]), f.worst = int(i);
  if (f.worst >= 0) f.negative = largest > 0 ? worst / largest : 1;
  f.y.resize(m * f.rank);
  for (std::size_t i = 0; i < m; ++i)
    for (int k = 0; k < f.rank; ++k) f.y[i * f.rank + k] = columns[k * m + i];
  return f;
}

}  // namespace stickslip::contact
