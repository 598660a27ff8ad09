// G = Y Y^T by Cholesky with diagonal pivoting: turns an explicit problem into a factored one and
// finds out on the way whether G is positive semidefinite.
#pragma once
#include <vector>

namespace stickslip::contact {

struct DenseFactor {
  int size = 0;
  int rank = 0;
  std::vector<double> y;  // (size, rank) row-major: G = Y Y^T up to rounding
  int worst = -1;         // where the rest that Y leaves is largest, if G is indefinite
  double negative = 0;    // how large that rest is, relative to the largest diagonal entry; 0:
                          // positive semidefinite
};

/// `G` (size, size) row-major, symmetric. Pivots below 1e-14 of the largest diagonal entry count as
/// zero. A rest above 1e-6 of it means that G is indefinite; below, that G was rounded to few
/// digits (files), and Y Y^T is that much off.
DenseFactor factor_dense(const double* G, int size);

}  // namespace stickslip::contact
