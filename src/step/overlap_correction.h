// Moves overlapping points to the surface without touching a velocity (docs/theory/step.md, overlap
// correction).
//
//   delta = L^-1 Z^T x,   0 <= x  complementary to  gap + Z Z^T x >= 0
// Z: normal rows at the present positions of the tree, with the factor as it is. Rows of the old
// positions would overshoot on stretched legs.
#pragma once
#include <vector>

#include "collide/ground_shapes.h"

namespace stickslip::step {

class OverlapCorrection {
 public:
  OverlapCorrection(int max_points, int num_dofs);

  /// Starts a new list of points.
  void clear() { count_ = 0; }
  /// A point at `position` (relative to the base origin) and its gap [m].
  void add(dynamics::LinkIndex link, const Vec3<double>& position, double gap);
  /// Leaves delta in L-space in the tree's x; false if no gap is below -tolerance.
  bool run(dynamics::Tree<double>& tree, double tolerance);

 private:
  void build_rows(const dynamics::Tree<double>& tree);
  void build_gram();
  void iterate(double accuracy);

  int num_dofs_, count_ = 0, stride_ = 0;  // stride: contacts rounded up to whole packs
  std::vector<dynamics::LinkIndex> links_;
  std::vector<Vec3<double>> positions_;
  std::vector<double> rows_;  // entry (dof, point) at dof * stride + point
  std::vector<double> gram_;  // Z Z^T
  std::vector<double> gaps_, pushes_;
};

}  // namespace stickslip::step
