// A factored problem as a dense one, for users and for the methods of [Hwangbo 2018], and a dense
// solution back.
#pragma once
#include "contact/factored_problem.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// G_ij = Y_i Y_j^T over the dofs that both touch, plus P_i where i = j; entries[r][s]: row s of i,
/// row r of j.
inline void delassus_block(const FactoredProblem<double>& p, int i, int j, double entries[3][3]) {
  const FactoredContact<double>&a = p.contact(i), &b = p.contact(j);
  const bool six = p.six();
  const int na = six ? 6 : a.count, nb = six ? 6 : b.count;
  Row3<double> columns[3];
  for (auto& column : columns) column = make_row3(0.0, 0.0, 0.0);
  for (int ka = 0, kb = 0; ka < na && kb < nb;) {
    const int da = six ? ka : a.index[ka], db = six ? kb : b.index[kb];
    if (da != db) {
      da < db ? ++ka : ++kb;
      continue;
    }
    double row[3];
    store(b.y[kb++], row);
    for (int r = 0; r < 3; ++r) columns[r] = madd(a.y[ka], row[r], columns[r]);
    ++ka;
  }
  for (int r = 0; r < 3; ++r) store(columns[r], entries[r]);
  if (i != j) return;
  const double* q = a.private_block;
  const double own[3][3] = {{q[0], q[1], q[2]}, {q[1], q[3], q[4]}, {q[2], q[4], q[5]}};
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s) entries[r][s] += own[r][s];
}

/// G (3n, 3n) row-major, c (3n), mu (n), impulses as they are (3n).
inline void write_out(const FactoredProblem<double>& p, double* g, double* c, double* mu,
                      double* lambda) {
  const int n = p.size(), m = 3 * n;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      double entries[3][3];
      delassus_block(p, i, j, entries);
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s)
          g[(3 * i + s) * m + 3 * j + r] = g[(3 * j + r) * m + 3 * i + s] = entries[r][s];
    }
    const FactoredContact<double>& a = p.contact(i);
    Row3<double> free = make_row3(a.offset[0], a.offset[1], a.offset[2]);
    for (int k = 0; k < (p.six() ? 6 : a.count); ++k)
      free = madd(a.y[k], p.w0[p.six() ? k : a.index[k]], free);
    store(free, c + 3 * i);
    mu[i] = a.friction;
    for (int r = 0; r < 3; ++r) lambda[3 * i + r] = a.impulse[r];
  }
}

/// Takes impulses and velocities (3n) that a dense solve found; w follows.
inline void read_back(FactoredProblem<double>& p, const double* lambda, const double* velocity) {
  for (int k = 0; k < p.dofs(); ++k) p.w[k] = p.w0[k];
  for (int i = 0; i < p.size(); ++i) {
    FactoredContact<double>& a = p.contact(i);
    for (int r = 0; r < 3; ++r)
      a.impulse[r] = lambda[3 * i + r], a.velocity[r] = velocity[3 * i + r];
    for (int k = 0; k < (p.six() ? 6 : a.count); ++k) {
      double y[3], &w = p.w[p.six() ? k : a.index[k]];
      store(a.y[k], y);
      for (int r = 0; r < 3; ++r) w = madd(y[r], a.impulse[r], w);
    }
  }
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
