#include "solvers/block_system.h"

#include "solvers/dense_lu.h"
#include "solvers/large_system.h"

namespace stickslip::solvers {

BlockSystem::BlockSystem() = default;
BlockSystem::~BlockSystem() = default;

void BlockSystem::assemble_dense(const contact::ExplicitProblem& p, const std::vector<int>& active,
                                 const double* A, const double* B) {
  const int n = int(active.size()), m = size_;
  matrix_.resize(size_t(m) * m);
  pivot_.resize(m);
  double* __restrict__ out = matrix_.data();
  for (int a = 0; a < n; ++a) {
    const int i = active[a];
    const double* b = B + 9L * i;
    double* row = out + 3L * a * m;
    if (p.starts)
      for (int k = 0; k < 3 * m; ++k) row[k] = 0;
    int position = 0;
    contact::for_each_block(p, i, [&](int j, const double* g, int stride) {
      while (position < n && active[position] < j) ++position;
      if (position == n || active[position] != j) return;
      double* to = row + 3 * position;
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s)
          to[r * m + s] = madd(b[3 * r], g[s], madd(b[3 * r + 1], g[stride + s], b[3 * r + 2] * g[2 * stride + s]));
    });
    for (int r = 0; r < 3; ++r)
      for (int s = 0; s < 3; ++s) row[r * m + 3 * a + s] += A[9L * i + 3 * r + s];
  }
}

bool BlockSystem::factor(const contact::ExplicitProblem& p, const std::vector<int>& active,
                         const double* A, const double* B) {
  size_ = 3 * int(active.size());
  large_ = size_ > kDenseRows;
  if (large_) {
    if (!library_) library_ = std::make_unique<LargeSystem>();
    return library_->factor(p, active, A, B);
  }
  assemble_dense(p, active, A, B);
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
