// Dense problems for the tests of the public API: robots, towers of boxes.
#pragma once
#include <stickslip/contact.h>

#include "contact/robot_problems.h"

namespace problems {

inline stickslip::ContactProblem dense(const RobotProblem& p) {
  stickslip::ContactProblem d;
  const int m = 3 * p.n;
  d.delassus.resize(m * m);
  d.friction.assign(p.n, p.mu);
  for (int i = 0; i < m; ++i) {
    d.free_velocity.push_back(p.c0[i / 3][i % 3]);
    for (int j = 0; j < m; ++j)
      for (int k = 0; k < 18; ++k)
        d.delassus[i * m + j] += p.y[i / 3][i % 3][k] * p.y[j / 3][j % 3][k];
  }
  return d;
}

/// A tower of cubes of 0.2 m with four corner contacts per interface, at rest for one step of 1 ms,
/// the top one pushed sideways by `push` [N]. G has rank 6 per cube at most, its contacts 12 rows.
inline stickslip::ContactProblem tower(const std::vector<double>& masses, double mu,
                                       double push = 0, int copies = 1) {
  constexpr double kSize = 0.2, kStep = 1e-3;
  const int n = int(masses.size()), dofs = 6 * n;
  std::vector<double> inverse(dofs), u(dofs);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 6; ++k)
      inverse[6 * i + k] = 1 / (k < 3 ? masses[i] : masses[i] * kSize * kSize / 6);
  for (int i = 0; i < n; ++i) u[6 * i + 2] = -9.81 * kStep;
  u[6 * (n - 1)] += push * kStep / masses[n - 1];
  std::vector<double> rows;
  const auto fill = [&](double* row, int body, const double p[3], double sign) {
    // v = V + omega x p
    const double skew[3][3] = {{0, p[2], -p[1]}, {-p[2], 0, p[0]}, {p[1], -p[0], 0}};
    for (int r = 0; r < 3; ++r) {
      row[r * dofs + 6 * body + r] = sign;
      for (int k = 0; k < 3; ++k) row[r * dofs + 6 * body + 3 + k] = sign * skew[r][k];
    }
  };
  int contacts = 0;
  for (int i = 0; i < n; ++i)
    for (int corner = 0; corner < 4; ++corner)
      for (int copy = 0; copy < copies; ++copy, ++contacts) {
        rows.resize(3 * (contacts + 1) * dofs, 0);
        double* row = rows.data() + 3 * contacts * dofs;
        const double x = corner & 1 ? kSize / 2 : -kSize / 2,
                     y = corner & 2 ? kSize / 2 : -kSize / 2;
        const double below[3] = {x, y, -kSize / 2}, above[3] = {x, y, kSize / 2};
        fill(row, i, below, 1);
        if (i > 0) fill(row, i - 1, above, -1);
      }
  const int m = 3 * contacts;
  stickslip::ContactProblem p;
  p.delassus.resize(m * m);
  p.free_velocity.resize(m);
  p.friction.assign(contacts, mu);
  for (int a = 0; a < m; ++a) {
    for (int k = 0; k < dofs; ++k) p.free_velocity[a] += rows[a * dofs + k] * u[k];
    for (int b = 0; b < m; ++b)
      for (int k = 0; k < dofs; ++k)
        p.delassus[a * m + b] += rows[a * dofs + k] * inverse[k] * rows[b * dofs + k];
  }
  return p;
}

inline double largest(const std::vector<double>& x) {
  double worst = 0;
  for (double e : x) worst = std::fmax(worst, std::fabs(e));
  return worst;
}

}  // namespace problems
