#include "step/overlap_correction.h"

#include <algorithm>
#include <cmath>

#include "dynamics/contact_rows.h"

namespace stickslip::step {
namespace {

constexpr int kMaxSweeps = 50;
constexpr int kBaseDofs = 6;  // rows of the base come first, also where it is fixed (then zero)

}  // namespace

OverlapCorrection::OverlapCorrection(int max_points, int num_dofs)
    : num_dofs_(num_dofs),
      links_(max_points),
      positions_(max_points),
      rows_(static_cast<size_t>(max_points + 3) * num_dofs),
      gram_(static_cast<size_t>(max_points + 3) * max_points),
      gaps_(max_points + 3),
      pushes_(max_points + 3) {}

void OverlapCorrection::add(dynamics::LinkIndex link, const Vec3<double>& position, double gap) {
  links_[count_] = link;
  positions_[count_] = position;
  gaps_[count_++] = gap;
}

bool OverlapCorrection::run(dynamics::Tree<double>& tree, double tolerance) {
  bool overlap = false;
  for (int i = 0; i < count_; ++i) overlap = overlap || gaps_[i] < -tolerance;
  if (!overlap) return false;
  stride_ = (count_ + 3) / 4 * 4;
  build_rows(tree);
  build_gram();
  iterate(0.1 * tolerance);
  const auto displacement = [&](int dof) {
    double sum = 0;
    for (int i = 0; i < count_; ++i)
      sum = madd(rows_[static_cast<size_t>(dof) * stride_ + i], pushes_[i], sum);
    return sum;
  };
  for (int k = 0; k < kBaseDofs; ++k) tree.base.x[k] = displacement(k);
  for (int slot = 0; slot < tree.num_slots; ++slot)
    for (int lane = 0; lane < dynamics::kMaxLanes; ++lane)
      set_lane(tree.links[slot].x, lane, displacement(kBaseDofs + tree.slots[slot].joint[lane]));
  return true;
}

void OverlapCorrection::build_rows(const dynamics::Tree<double>& tree) {
  std::fill(rows_.begin(), rows_.begin() + static_cast<long>(num_dofs_) * stride_, 0.0);
  for (int i = 0; i < count_; ++i) {
    double base[kBaseDofs];
    dynamics::compute_row(tree, links_[i], positions_[i], {0.0, 0.0, 1.0}, base,
                          [&](dynamics::LinkIndex link, double entry) {
                            const int dof = kBaseDofs + tree.slots[link.slot].joint[link.lane];
                            rows_[static_cast<size_t>(dof) * stride_ + i] = entry;
                          });
    if (!tree.floating) continue;
    for (int k = 0; k < kBaseDofs; ++k) rows_[static_cast<size_t>(k) * stride_ + i] = base[k];
  }
}

void OverlapCorrection::build_gram() {
  for (int j = 0; j < count_; ++j) {
    double* column = gram_.data() + static_cast<size_t>(j) * stride_;
    std::fill(column, column + stride_, 0.0);
    for (int k = 0; k < num_dofs_; ++k) {
      const double* row = rows_.data() + static_cast<size_t>(k) * stride_;
      if (row[j] == 0) continue;
      for (int i = 0; i < stride_; ++i) column[i] = madd(row[i], row[j], column[i]);
    }
  }
}

/// Projected Gauss-Seidel on 0 <= x, gap + Z Z^T x >= 0; the gaps are kept up to date.
void OverlapCorrection::iterate(double accuracy) {
  std::fill(pushes_.begin(), pushes_.end(), 0.0);
  std::fill(gaps_.begin() + count_, gaps_.begin() + stride_, 0.0);
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    double change = 0;
    for (int i = 0; i < count_; ++i) {
      const double* column = gram_.data() + static_cast<size_t>(i) * stride_;
      if (!(column[i] > 0)) continue;
      const double next = std::max(0.0, pushes_[i] - gaps_[i] / column[i]);
      const double step = next - pushes_[i];
      pushes_[i] = next;
      for (int j = 0; j < stride_; ++j) gaps_[j] = madd(column[j], step, gaps_[j]);
      change = std::max(change, std::fabs(step) * column[i]);
    }
    if (change < accuracy) break;
  }
}

}  // namespace stickslip::step
