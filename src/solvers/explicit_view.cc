#include "solvers/explicit_view.h"

#include <algorithm>

namespace stickslip::solvers {
namespace {

constexpr int kSparseFrom = 60;      // contacts; below, dense rows are faster than indices
constexpr double kDenseShare = 0.5;  // of the blocks

}  // namespace

ExplicitView::ExplicitView(const ContactProblem& problem, const std::vector<double>& impulse) {
  const int n = problem.num_contacts();
  const long size = contact::ExplicitProblem::workspace_size(n);
  memory_.resize(size + 3L * n + 1);
  double* lambda = memory_.data() + size;
  std::copy(impulse.begin(), impulse.end(), lambda);
  view.n = n;
  view.G = problem.delassus.data();
  view.c = problem.free_velocity.data();
  view.mu = problem.friction.data();
  view.lambda = lambda;
  view.attach(memory_.data());
  if (problem.is_block_sparse()) {
    view.starts = problem.block_starts.data();
    view.columns = problem.block_columns.data();
  } else if (n >= kSparseFrom) {
    drop_zero_blocks(problem);
  }
  contact::prepare(view);
}

void ExplicitView::drop_zero_blocks(const ContactProblem& problem) {
  const int n = view.n, m = 3 * n;
  const auto block = [&](int i, int j) { return problem.delassus.data() + 3L * i * m + 3 * j; };
  starts_.assign(1, 0);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j)
      if (i == j || !contact::is_zero_block(block(i, j), m)) columns_.push_back(j);
    starts_.push_back(int(columns_.size()));
  }
  if (double(columns_.size()) > kDenseShare * n * n) return;
  blocks_.reserve(9 * columns_.size());
  for (int i = 0; i < n; ++i)
    for (int k = starts_[i]; k < starts_[i + 1]; ++k)
      for (int r = 0; r < 3; ++r) {
        const double* row = block(i, columns_[k]) + long(r) * m;
        blocks_.insert(blocks_.end(), row, row + 3);
      }
  view.G = blocks_.data();
  view.starts = starts_.data();
  view.columns = columns_.data();
}

}  // namespace stickslip::solvers
