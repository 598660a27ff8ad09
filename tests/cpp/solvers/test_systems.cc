// What the methods are built on: linear systems, the map of Alart and Curnier and its derivative.
#include "check.h"
#include "scenes/problem_families.h"
#include "scenes/random.h"
#include "solvers/alart_curnier.h"
#include "solvers/block_system.h"
#include "solvers/explicit_view.h"

using namespace stickslip;
using solvers::BlockSystem;
using solvers::Integers;

namespace {

/// Largest entry of (A + B G) x - f over the active contacts.
double defect(const contact::ExplicitProblem& p, const Integers& active,
              const std::vector<double>& A, const std::vector<double>& B,
              const std::vector<double>& x, const std::vector<double>& f) {
  double worst = 0;
  for (std::size_t a = 0; a < active.size(); ++a) {
    double g[3] = {};
    contact::for_each_block(p, active[a], [&](int j, const double* block, int stride) {
      for (std::size_t b = 0; b < active.size(); ++b)
        if (active[b] == j)
          for (int r = 0; r < 3; ++r)
            for (int s = 0; s < 3; ++s) g[r] += block[r * stride + s] * x[3 * b + s];
    });
    for (int r = 0; r < 3; ++r) {
      double sum = -f[3 * a + r];
      for (int s = 0; s < 3; ++s)
        sum += A[9 * active[a] + 3 * r + s] * x[3 * a + s] + B[9 * active[a] + 3 * r + s] * g[s];
      worst = std::max(worst, std::fabs(sum));
    }
  }
  return worst;
}

void check_systems(const ContactProblem& problem, int skip) {
  const solvers::ExplicitView e(problem, {});
  const int n = problem.num_contacts();
  scenes::Random rng(7);
  std::vector<double> A(9 * n), B(9 * n);
  for (double& a : A) a = rng.normal();
  for (double& b : B) b = 0.3 * rng.normal();
  for (int i = 0; i < n; ++i)
    for (int r = 0; r < 3; ++r) A[9 * i + 4 * r] += 5, B[9 * i + 4 * r] += 1;
  Integers active;
  for (int i = 0; i < n; ++i)
    if (skip == 0 || i % skip != 1) active.push_back(i);
  std::vector<double> f(3 * active.size());
  for (double& x : f) x = rng.normal();
  BlockSystem system(n, std::pmr::get_default_resource());
  std::vector<double> x = f, y = f;
  CHECK(system.solve_once(e.view, active, A.data(), B.data(), x.data()));
  CHECK(defect(e.view, active, A, B, x, f) < 1e-10);
  CHECK(system.factor(e.view, active, A.data(), B.data()));
  system.solve(y.data());
  CHECK(defect(e.view, active, A, B, y, f) < 1e-10);
}

}  // namespace

TEST(SystemsAreSolvedInEveryForm) {
  for (const int skip : {0, 2, 3}) {
    check_systems(scenes::random_problem("quadruped_impact", 0), skip);  // dense, own elimination
    check_systems(scenes::random_problem("eight_contacts_impact", 1), skip);
    scenes::BrickWallOptions small, large;
    small.rows = 2, small.columns = 2, large.rows = 6, large.columns = 6;
    check_systems(scenes::brick_wall(0, small), skip);  // blocks, own elimination
    check_systems(scenes::brick_wall(0, large), skip);  // blocks, sparse factors
  }
}

TEST(ASystemThatNeedsPivotsIsSolved) {
  // Zero leading entries: elimination without row exchanges breaks down at once.
  ContactProblem p{std::vector<double>(36), std::vector<double>(6), {0.5, 0.5}};
  for (int i = 0; i < 6; ++i) p.delassus[7 * i] = 1;
  std::vector<double> A(18), B(18);
  for (int c = 0; c < 2; ++c)
    A[9 * c + 1] = 2, A[9 * c + 5] = 3, A[9 * c + 6] = 4;  // a permutation
  const solvers::ExplicitView e(p, {});
  const Integers active = {0, 1};
  const std::vector<double> f = {2, 3, 4, 4, 6, 8};
  std::vector<double> x = f;
  BlockSystem system(2, std::pmr::get_default_resource());
  CHECK(system.solve_once(e.view, active, A.data(), B.data(), x.data()));
  for (int i = 0; i < 6; ++i) CHECK_NEAR(x[i], i < 3 ? 1 : 2, 1e-15);
}

TEST(TheMapsDerivativeIsThatOfDifferences) {
  scenes::Random rng(11);
  int modes[3] = {};
  for (int i = 0; i < 3000; ++i) {
    contact::LocalContact<double> k{};
    k.scale = rng.uniform(0.1, 3), k.mu = rng.uniform(0.1, 2), k.inv_zz = 1;
    double lambda[3], u[3], dl[3], du[3], moved[2][3][3], F[2][3];
    for (int r = 0; r < 3; ++r)
      lambda[r] = rng.normal(), u[r] = rng.normal(), dl[r] = rng.normal(), du[r] = rng.normal();
    solvers::AlartCurnier c;
    solvers::alart_curnier(k, lambda, u, c);
    constexpr double kStep = 1e-6;
    for (int side = 0; side < 2; ++side) {
      const double h = side ? kStep : -kStep;
      for (int r = 0; r < 3; ++r)
        moved[side][0][r] = lambda[r] + h * dl[r], moved[side][1][r] = u[r] + h * du[r];
      solvers::alart_curnier_value(k, moved[side][0], moved[side][1], F[side]);
    }
    const double s = k.scale * lambda[2] - u[2];
    const double t = std::hypot(k.scale * lambda[0] - u[0], k.scale * lambda[1] - u[1]);
    if (std::fabs(s) < 1e-3 || std::fabs(t - k.mu * std::max(s, 0.0)) < 1e-3) continue;  // a kink
    ++modes[s <= 0 ? 0 : t <= k.mu * s ? 1 : 2];
    CHECK(c.active == (s > 0));
    for (int r = 0; r < 3; ++r) {
      double slope = 0;
      for (int q = 0; q < 3; ++q) slope += c.A[3 * r + q] * dl[q] + c.B[3 * r + q] * du[q];
      CHECK_NEAR(slope, (F[1][r] - F[0][r]) / (2 * kStep), 1e-5 * (1 + std::fabs(slope)));
    }
  }
  for (const int count : modes) CHECK(count > 300);
}
