#include "solvers/minimum_norm.h"

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "solvers/cones.h"
#include "solvers/islands.h"

namespace stickslip::solvers {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int kRounds = 500;        // of projections; one where no set is reached
constexpr double kSettled = 1e-14;  // distance of the two sets' points, relative to them
constexpr int kMostContacts = 500;  // of an island: its matrix is dense here
constexpr double kRankTolerance =
    1e-11;  // pivots of G below this much of the largest count as zero

/// Those contacts whose velocity is zero, as far as `rows` of it count.
std::vector<int> resting(const contact::ExplicitProblem& p, const std::vector<int>& of,
                         double speed, int rows) {
  std::vector<int> out;
  for (const int i : of) {
    double square = 0;
    for (int r = 0; r < rows; ++r) square += p.v[3 * i + r] * p.v[3 * i + r];
    if (p.local[i].inv_zz > 0 && square <= speed * speed) out.push_back(i);
  }
  return out;
}

/// G between the first `rows` rows of these contacts.
Eigen::MatrixXd block_between(const contact::ExplicitProblem& p, const std::vector<int>& contacts,
                              int rows) {
  std::vector<int> place(p.n, -1);
  for (std::size_t a = 0; a < contacts.size(); ++a) place[contacts[a]] = int(a);
  const Index m = rows * Index(contacts.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(m, m);
  for (std::size_t a = 0; a < contacts.size(); ++a)
    contact::for_each_block(p, contacts[a], [&](int j, const double* g, int stride) {
      if (place[j] < 0) return;
      for (int r = 0; r < rows; ++r)
        for (int s = 0; s < rows; ++s)
          G(rows * Index(a) + r, rows * place[j] + s) = g[r * stride + s];
    });
  return G;
}

/// (C70): the projection of zero on {x : G x = G x0} and a convex set, by Dykstra's alternating
/// projections; `project(x)` puts x into the set. G is semidefinite, so what this block of it does
/// not see no other row sees either.
template <class F>
VectorXd least_norm(const Eigen::MatrixXd& G, const VectorXd& x0, F&& project) {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> pseudo_inverse;
  pseudo_inverse.setThreshold(kRankTolerance);
  pseudo_inverse.compute(G);
  if (pseudo_inverse.rank() == G.rows()) return x0;  // no choice
  const VectorXd moved = G * x0;
  VectorXd x = pseudo_inverse.solve(moved), correction = VectorXd::Zero(x0.size());
  for (int round = 0; round < kRounds; ++round) {
    VectorXd inside = x + correction;
    project(inside);
    correction += x - inside;
    x = inside + pseudo_inverse.solve(moved - G * inside);
    if ((x - inside).norm() <= kSettled * x.norm()) return inside;  // in both sets
  }
  project(x);
  return x;
}

/// Replaces the first `rows` impulses of these contacts by those of least norm; `project(x,
/// contacts)`.
template <class F>
void minimize(contact::ExplicitProblem& p, const std::vector<int>& contacts, int rows,
              F&& project) {
  VectorXd x(rows * Index(contacts.size()));
  for (std::size_t a = 0; a < contacts.size(); ++a)
    for (int r = 0; r < rows; ++r) x[rows * Index(a) + r] = p.lambda[3 * contacts[a] + r];
  x = least_norm(block_between(p, contacts, rows), x, [&](VectorXd& to) { project(to, contacts); });
  for (std::size_t a = 0; a < contacts.size(); ++a)
    for (int r = 0; r < rows; ++r) p.lambda[3 * contacts[a] + r] = x[rows * Index(a) + r];
}

/// Island by island: what counts as zero in one says nothing of another.
template <class F>
void minimize_islands(contact::ExplicitProblem& p, double speed, int rows, F&& project) {
  const Islands islands(p);
  for (int k = 0; k < islands.count(); ++k) {
    const std::vector<int> contacts = resting(p, islands.contacts(k), speed, rows);
    if (!contacts.empty() && int(contacts.size()) <= kMostContacts)
      minimize(p, contacts, rows, project);
  }
}

}  // namespace

void spread_impulses(contact::ExplicitProblem& p, double speed) {
  minimize_islands(p, speed, 3, [&](VectorXd& x, const std::vector<int>& contacts) {
    for (std::size_t a = 0; a < contacts.size(); ++a)
      project_on_cone(p.local[contacts[a]].mu, x.data() + 3 * a);
  });
}

void minimize_tangential_impulses(contact::ExplicitProblem& p, double speed) {
  minimize_islands(p, speed, 2, [&](VectorXd& x, const std::vector<int>& contacts) {
    for (std::size_t a = 0; a < contacts.size(); ++a) {
      auto tangential = x.segment<2>(2 * Index(a));
      const double length = tangential.norm();
      const double limit = p.local[contacts[a]].mu * p.lambda[3 * contacts[a] + 2];
      if (length > limit) tangential *= limit / length;
    }
  });
}

}  // namespace stickslip::solvers
