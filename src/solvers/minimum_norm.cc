#include "solvers/minimum_norm.h"

#include <Eigen/Dense>
#include <cmath>
#include <vector>

namespace stickslip::solvers {
namespace {

constexpr int kRounds = 200;        // of projections; one where no cone is reached
constexpr double kSettled = 1e-15;  // change of a round, relative to the impulses
constexpr double kRankTolerance =
    1e-11;  // pivots of G below this much of the largest count as zero

bool sticks(const contact::ExplicitProblem& p, int i, double speed) {
  const double *v = p.v + 3 * i, *l = p.lambda + 3 * i;
  return l[2] > 0 && v[0] * v[0] + v[1] * v[1] <= speed * speed;
}

/// G between the tangential rows of these contacts.
Eigen::MatrixXd tangential_block(const contact::ExplicitProblem& p, const std::vector<int>& stick) {
  std::vector<int> place(p.n, -1);
  for (std::size_t a = 0; a < stick.size(); ++a) place[stick[a]] = int(a);
  const Eigen::Index m = 2 * Eigen::Index(stick.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(m, m);
  for (std::size_t a = 0; a < stick.size(); ++a)
    contact::for_each_block(p, stick[a], [&](int j, const double* g, int stride) {
      if (place[j] < 0) return;
      for (int r = 0; r < 2; ++r)
        for (int s = 0; s < 2; ++s)
          G(2 * Eigen::Index(a) + r, 2 * place[j] + s) = g[r * stride + s];
    });
  return G;
}

}  // namespace

// (C70). The answer is the projection of zero on {x : G x = G x0} and the friction discs, by
// Dykstra's alternating projections. G is semidefinite, so what its tangential block does not see
// no other row sees either.
void minimize_tangential_impulses(contact::ExplicitProblem& p, double speed) {
  std::vector<int> stick;
  for (int i = 0; i < p.n; ++i)
    if (sticks(p, i, speed)) stick.push_back(i);
  if (stick.empty()) return;
  const Eigen::MatrixXd G = tangential_block(p, stick);
  const Eigen::Index m = G.rows();
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> pseudo_inverse;
  pseudo_inverse.setThreshold(kRankTolerance);
  pseudo_inverse.compute(G);
  if (pseudo_inverse.rank() == m) return;  // no choice
  Eigen::VectorXd start(m), limit(m / 2);
  for (Eigen::Index a = 0; a < m / 2; ++a) {
    const double* l = p.lambda + 3 * stick[a];
    start[2 * a] = l[0], start[2 * a + 1] = l[1];
    limit[a] = p.local[stick[a]].mu * l[2];
  }
  const Eigen::VectorXd moved = G * start;
  Eigen::VectorXd x = pseudo_inverse.solve(moved), correction = Eigen::VectorXd::Zero(m);
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::VectorXd before = x, outside = x + correction;
    for (Eigen::Index a = 0; a < m / 2; ++a) {
      const double length = outside.segment<2>(2 * a).norm();
      x.segment<2>(2 * a) =
          outside.segment<2>(2 * a) * (length > limit[a] ? limit[a] / length : 1.0);
    }
    correction = outside - x;
    if (correction.isZero(0)) break;
    x += pseudo_inverse.solve(moved - G * x);
    if ((x - before).norm() <= kSettled * x.norm()) break;
  }
  for (Eigen::Index a = 0; a < m / 2; ++a)
    for (int r = 0; r < 2; ++r) p.lambda[3 * stick[a] + r] = x[2 * a + r];
  contact::refresh_velocity(p);
}

}  // namespace stickslip::solvers
