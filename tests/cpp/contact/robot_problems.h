// Random problems of several contacts on a quadruped, factored and dense. Plain double code for
// tests and benchmarks.
#pragma once
#include "contact/factored.h"
#include "contact/random_problems.h"

namespace problems {

enum Scene { kStand, kImpact, kRestEight, kDropEight, kDropTwelve, kSoles, kNumScenes };
inline const char* scene_name(int s) {
  static const char* const names[] = {
      "stand, 4 feet", "impact, 4 feet",      "rest, 4 feet + 4 corners",
      "drop, 4 + 4",   "drop, 4 + 8 corners", "two soles of 4 contacts"};
  return names[s];
}

/// Contact rows in the coordinates of the factor, v = c0 + Y x with M^-1 = L^-1 L^-T and Y = J
/// L^-1.
struct RobotProblem {
  int n = 0, m = 6;
  double y[12][3][18], c0[12][3], mu = 0.8;
  int leg[12];  // -1: torso
  bool soles = false;
};

inline RobotProblem random_robot_problem(int scene, Random& rng) {
  const Quadruped robot(rng);
  RobotProblem p;
  double u[18];
  const double size = scene == kStand ? 1e-3 : scene == kRestEight ? 1e-2 : 2.0;
  for (double& x : u) x = size * rng.normal();
  if (scene == kImpact || scene >= kDropEight) u[2] -= 3;
  u[2] -= 9.81e-3;
  if (scene == kStand || scene == kRestEight)
    for (int j = 6; j < 18; ++j) u[j] += 0.3 * rng.normal();
  p.mu = rng.uniform(0.3, 1.0);
  p.soles = scene == kSoles;
  const int corners = scene == kDropTwelve ? 8 : scene >= kRestEight && scene <= kDropEight ? 4 : 0;
  p.n = p.soles ? 8 : 4 + corners;
  p.m = p.soles ? 12 : 6;
  for (int i = 0; i < p.n; ++i) {
    p.leg[i] = p.soles ? i / 4 : i < 4 ? i : -1;
    const auto& rows = p.soles ? robot.sole_rows[i / 4][i % 4] : robot.rows[i];
    project_rows(robot, rows, p.y[i]);
    for (int r = 0; r < 3; ++r) {
      p.c0[i][r] = 0;
      for (int k = 0; k < 18; ++k) p.c0[i][r] += rows[r][k] * u[k];
    }
  }
  return p;
}

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
