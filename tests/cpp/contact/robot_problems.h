// The quadruped's problems (scenes/quadruped.h) in the factored form of a step, for tests and
// benchmarks of its solver.
#pragma once
#include <cmath>
#include <cstring>

#include "contact/factored.h"
#include "scenes/quadruped.h"

namespace problems {

using namespace stickslip::scenes;

/// Writes the problem into one lane.
template <class S>
void fill(stickslip::contact::FactoredProblem<S>& f, const RobotProblem& p, int lane) {
  using stickslip::Value;
  const auto put = [lane](S& to, double x) { stickslip::set_lane(to, lane, Value<S>(x)); };
  if (lane == 0) f.clear(p.m);
  for (int i = 0; i < p.n; ++i) {
    if (lane == 0) f.add();
    // Shared columns of the rows: the base, and for soles the leg's own three, which only its four
    // contacts touch.
    int columns[9] = {0, 1, 2, 3, 4, 5}, index[9] = {0, 1, 2, 3, 4, 5};
    const int count = p.soles ? 9 : 6;
    for (int k = 6; k < count; ++k) columns[k] = 3 * p.leg[i] + k, index[k] = 3 * p.leg[i] + k;
    if (p.soles && lane == 0) f.set_index(i, index, count);
    for (int k = 0; k < count; ++k) {
      S row[3] = {};
      if (lane > 0) stickslip::store(f.y(i)[k], row);
      for (int r = 0; r < 3; ++r) put(row[r], p.y[i][r][columns[k]]);
      f.y(i)[k] = stickslip::make_row3(row[0], row[1], row[2]);
    }
    int b = 0;
    for (int r = 0; r < 3; ++r)
      for (int s = r; s < 3; ++s, ++b) {
        double sum = 0;
        if (!p.soles)
          for (int k = 6; k < 18; ++k) sum += p.y[i][r][k] * p.y[i][s][k];
        put(f.private_block(i)[b], sum);
      }
    for (int r = 0; r < 3; ++r) put(f.offset(i)[r], p.c0[i][r]);
    put(f.friction(i), p.mu);
  }
}

/// Largest natural-map residual of the impulses, from the dense G = Y Y^T [m/s].
template <class S>
double dense_residual(const stickslip::contact::FactoredProblem<S>& f, const RobotProblem& p,
                      int lane) {
  double x[18] = {}, worst = 0;
  for (int i = 0; i < p.n; ++i)
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 18; ++k)
        x[k] += p.y[i][r][k] * double(stickslip::get_lane(f.contact(i).impulse[r], lane));
  for (int i = 0; i < p.n; ++i) {
    double v[3], l[3], g[3][3] = {};
    for (int r = 0; r < 3; ++r) {
      v[r] = p.c0[i][r], l[r] = stickslip::get_lane(f.contact(i).impulse[r], lane);
      for (int k = 0; k < 18; ++k) v[r] += p.y[i][r][k] * x[k];
      for (int s = 0; s < 3; ++s)
        for (int k = 0; k < 18; ++k) g[r][s] += p.y[i][r][k] * p.y[i][s][k];
    }
    stickslip::contact::LocalContact<double> k = {};
    k.xx = g[0][0], k.xy = g[0][1], k.xz = g[0][2], k.yy = g[1][1], k.yz = g[1][2], k.zz = g[2][2],
    k.mu = p.mu;
    stickslip::contact::prepare(k);
    const double e = stickslip::contact::natural_map_residual(k, v, l);
    worst = e > worst ? e : worst;
  }
  return worst;
}

}  // namespace problems
