#include "solvers/block_system.h"

#include "solvers/dense_lu.h"
#include "solvers/large_system.h"

namespace stickslip::solvers {

BlockSystem::BlockSystem(int contacts, Memory memory) : matrix_(memory), pivot_(memory) {
  const size_t rows = 3 * size_t(contacts);
  if (rows > kDenseRows) return;
  matrix_.reserve(rows * padded_row(int(rows) + 1) + kRowChunk);
  pivot_.reserve(rows);
}
BlockSystem::~BlockSystem() = default;

/// The matrix of (C28), rows `stride` apart. Three rows at a time, over runs of contacts that
/// follow each other in G.
void BlockSystem::assemble_dense(const contact::ExplicitProblem& p, const Integers& active,
                                 const double* A, const double* B, int stride) {
  const int n = int(active.size());
  matrix_.resize(size_t(size_) * stride + kRowChunk);
  for (int a = 0; a < n; ++a) {
    const double* b = B + 9L * active[a];
    double* row = matrix_.data() + 3L * a * stride;
    // columns [first, first + count) of the system are `from` and what follows in rows of G.
    const auto multiply = [&](int first, int count, const double* from, int apart) {
      for (int r = 0; r < 3; ++r) {
        double* __restrict__ to = row + long(r) * stride + first;
        const double* __restrict__ g0 = from;
        const double* __restrict__ g1 = g0 + apart;
        const double* __restrict__ g2 = g1 + apart;
        const double b0 = b[3 * r], b1 = b[3 * r + 1], b2 = b[3 * r + 2];
        for (int k = 0; k < count; ++k) to[k] = madd(b0, g0[k], madd(b1, g1[k], b2 * g2[k]));
      }
    };
    if (p.starts) {
      for (long k = 0; k < 3L * stride; ++k) row[k] = 0;
      int position = 0;
      contact::for_each_block(p, active[a], [&](int j, const double* g, int apart) {
        while (position < n && active[position] < j) ++position;
        if (position < n && active[position] == j) multiply(3 * position, 3, g, apart);
      });
    } else {
      for (int first = 0, last; first < n; first = last) {
        for (last = first + 1; last < n && active[last] == active[last - 1] + 1;) ++last;
        multiply(3 * first, 3 * (last - first), p.row(3 * active[a]) + 3 * active[first], 3 * p.n);
      }
    }
    for (int r = 0; r < 3; ++r)
      for (int s = 0; s < 3; ++s)
        row[long(r) * stride + 3 * a + s] += A[9L * active[a] + 3 * r + s];
  }
}

bool BlockSystem::solve_once(const contact::ExplicitProblem& p, const Integers& active,
                             const double* A, const double* B, double* x) {
  size_ = 3 * int(active.size());
  if (size_ > kDenseRows) {
    if (!factor(p, active, A, B)) return false;
    solve(x);
    return true;
  }
  const int stride = padded_row(size_ + 1);
  assemble_dense(p, active, A, B, stride);
  for (int i = 0; i < size_; ++i) matrix_[size_t(i) * stride + size_] = x[i];
  eliminate(matrix_.data(), size_, stride, x);
  return true;
}

bool BlockSystem::factor(const contact::ExplicitProblem& p, const Integers& active, const double* A,
                         const double* B) {
  size_ = 3 * int(active.size());
  large_ = size_ > kDenseRows;
  if (large_) {
    if (!library_) library_ = std::make_unique<LargeSystem>();
    return library_->factor(p, active, A, B);
  }
  pivot_.resize(size_);
  assemble_dense(p, active, A, B, size_);
  factor_lu(matrix_.data(), size_, size_, pivot_.data());
  return true;
}

void BlockSystem::solve(double* x) {
  if (large_)
    library_->solve(x);
  else
    solve_lu(matrix_.data(), size_, size_, pivot_.data(), x);
}

}  // namespace stickslip::solvers
