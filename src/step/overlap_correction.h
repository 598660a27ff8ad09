// Moves overlapping points to the surface without touching a velocity (docs/theory/step.md, overlap
// correction).
//
//   delta = L^-1 Z^T x,   0 <= x  complementary to  gap + Z Z^T x >= 0
// Z: normal rows at the present positions of the tree, with the factor as it is. Rows of the old
// positions would overshoot on stretched legs.
#pragma once
#include "contact/factored_problem.h"
#include "dynamics/contact_rows.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template <class S>
class OverlapCorrection {
 public:
  void lay_out(contact::Arena& arena, int max_points, int num_dofs) {
    num_dofs_ = num_dofs;
    const int wide = contact::round_up(max_points, kGroup);
    links_ = arena.take<dynamics::LinkIndex>(max_points);
    positions_ = arena.take<Vec3<S>>(max_points);
    active_ = arena.take<Mask<S>>(max_points);
    rows_ = arena.take<S>(long(num_dofs) * wide);
    gram_ = arena.take<S>(long(max_points) * wide);
    gaps_ = arena.take<S>(wide);
    pushes_ = arena.take<S>(wide);
  }

  /// Starts a new list of points.
  void clear() { count_ = 0; }
  /// A point at `position` (relative to the base origin) and its gap [m], in the lanes that have
  /// it.
  void add(dynamics::LinkIndex link, const Vec3<S>& position, S gap, Mask<S> active) {
    links_[count_] = link;
    positions_[count_] = position;
    active_[count_] = active;
    gaps_[count_++] = gap;
  }
  /// Leaves delta in L-space in the tree's x (zero in other lanes); lanes with a gap below
  /// -tolerance.
  Mask<S> run(dynamics::Tree<S>& tree, S tolerance) {
    Mask<S> overlap = none<S>();
    for (int i = 0; i < count_; ++i) overlap = overlap | (active_[i] & (gaps_[i] < -tolerance));
    if (!any(overlap)) return overlap;
    stride_ = contact::round_up(count_, kGroup);
    build_rows(tree);
    build_gram();
    iterate(constant<S>(0.1) * tolerance, overlap);
    for (int k = 0; k < kBaseDofs; ++k) tree.base.x[k] = displacement(k);
    for (int slot = 0; slot < tree.num_slots; ++slot)
      for (int lane = 0; lane < dynamics::Tree<S>::kLanes; ++lane)
        dynamics::put_lane<S>(tree.links[slot].x, lane,
                              displacement(kBaseDofs + tree.slots[slot].joint[lane]));
    return overlap;
  }

 private:
  static constexpr int kBaseDofs = 6, kMaxSweeps = 50;
  static constexpr int kGroup = ScalarTraits<S>::kWidth == 1 ? 4 : 1;  // whole registers

  S displacement(int dof) const {
    S sum = constant<S>(0);
    for (int i = 0; i < count_; ++i) sum = madd(rows_[long(dof) * stride_ + i], pushes_[i], sum);
    return sum;
  }

  /// Rows of lanes that lack the point are zero.
  void build_rows(const dynamics::Tree<S>& tree) {
    const S zero = constant<S>(0), one = constant<S>(1);
    for (long k = 0; k < long(num_dofs_) * stride_; ++k) rows_[k] = zero;
    for (int i = 0; i < count_; ++i) {
      const Mask<S> active = active_[i];
      S base[kBaseDofs];
      dynamics::compute_row(tree, links_[i], positions_[i], Vec3<S>{zero, zero, one}, base,
                            [&](dynamics::LinkIndex link, S entry) {
                              const int dof = kBaseDofs + tree.slots[link.slot].joint[link.lane];
                              rows_[long(dof) * stride_ + i] = select(active, entry, zero);
                            });
      if (!tree.floating) continue;
      for (int k = 0; k < kBaseDofs; ++k)
        rows_[long(k) * stride_ + i] = select(active, base[k], zero);
    }
  }

  void build_gram() {
    for (int j = 0; j < count_; ++j) {
      S* column = gram_ + long(j) * stride_;
      for (int i = 0; i < stride_; ++i) column[i] = constant<S>(0);
      for (int k = 0; k < num_dofs_; ++k) {
        const S* row = rows_ + long(k) * stride_;
        if (!any((row[j] < constant<S>(0)) | (row[j] > constant<S>(0)))) continue;
        for (int i = 0; i < stride_; ++i) column[i] = madd(row[i], row[j], column[i]);
      }
    }
  }

  /// Projected Gauss-Seidel on 0 <= x, gap + Z Z^T x >= 0; the gaps are kept up to date. Lanes stop
  /// one by one.
  void iterate(S accuracy, Mask<S> live) {
    const S zero = constant<S>(0), one = constant<S>(1);
    for (int i = 0; i < stride_; ++i) pushes_[i] = zero;
    for (int i = count_; i < stride_; ++i) gaps_[i] = zero;
    for (int sweep = 0; sweep < kMaxSweeps && any(live); ++sweep) {
      S change = zero;
      for (int i = 0; i < count_; ++i) {
        const S *column = gram_ + long(i) * stride_, own = column[i];
        const Mask<S> moves = live & (own > zero);
        if (!any(moves)) continue;
        const S next = max(zero, pushes_[i] - gaps_[i] / select(moves, own, one));
        const S step = select(moves, next - pushes_[i], zero);
        pushes_[i] = select(moves, next, pushes_[i]);
        for (int j = 0; j < stride_; ++j) gaps_[j] = madd(column[j], step, gaps_[j]);
        change = max(change, abs(step) * own);
      }
      live = live & !(change < accuracy);
    }
  }

  int num_dofs_, count_ = 0, stride_ = 0;  // stride: contacts rounded up to whole packs
  dynamics::LinkIndex* links_;
  Vec3<S>* positions_;
  Mask<S>* active_;
  S* rows_;  // entry (dof, point) at dof * stride + point
  S* gram_;  // Z Z^T
  S *gaps_, *pushes_;
};

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
