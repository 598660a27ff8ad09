// What method "auto" must solve: whole families, each problem from a cold start, to a residual of
// 1e-8 of max|c| by the pure residual function. Counts are those the project promises.
#include <algorithm>
#include <cstddef>
#include <memory_resource>

#include "check.h"
#include "scenes/problem_families.h"
#include "scenes/random.h"
#include "solvers/chain.h"
#include "solvers/explicit_view.h"
#include "solvers/islands.h"

using namespace stickslip;

namespace {

double fastest(const ContactProblem& p) {
  double most = 0;
  for (double c : p.free_velocity) most = std::max(most, std::fabs(c));
  return most;
}

double worst_residual(const ContactProblem& p, const std::vector<double>& impulse) {
  const std::vector<double> each = residual(p, impulse);
  return each.empty() ? 0 : *std::max_element(each.begin(), each.end());
}

/// It moves along one line, and friction holds it there while it is driven in.
ContactProblem jammed_rail() {
  const double t[3] = {1.45, 0.54, 0.33};
  ContactProblem p{std::vector<double>(9), {1.0421, -0.6304, -1.0035}, {1.123}};
  for (int k = 0; k < 9; ++k) p.delassus[k] = t[k / 3] * t[k % 3];
  return p;
}

ContactProblem heavy_stack(int seed) {
  scenes::BoxStackOptions o;
  o.num_boxes = 4, o.mass_ratio = 1e4, o.heavy = scenes::HeavyBoxes::kTop;
  return scenes::box_stack(seed, o);
}

/// Both as one problem without a coupling block.
ContactProblem beside(const ContactProblem& a, const ContactProblem& b) {
  const int na = 3 * a.num_contacts(), nb = 3 * b.num_contacts(), m = na + nb;
  ContactProblem both{std::vector<double>(m * m), a.free_velocity, a.friction};
  for (int i = 0; i < na; ++i)
    for (int j = 0; j < na; ++j) both.delassus[i * m + j] = a.delassus[i * na + j];
  for (int i = 0; i < nb; ++i)
    for (int j = 0; j < nb; ++j) both.delassus[(na + i) * m + na + j] = b.delassus[i * nb + j];
  both.free_velocity.insert(both.free_velocity.end(), b.free_velocity.begin(),
                            b.free_velocity.end());
  both.friction.insert(both.friction.end(), b.friction.begin(), b.friction.end());
  return both;
}

SolveOptions relative(double tolerance) {
  SolveOptions o;
  o.tolerance = 0, o.relative_tolerance = tolerance;
  return o;
}

/// How many of the problems are left above 1e-8 of max|c|; every status must tell the truth.
template <class F>
int unsolved(const char* name, int count, F&& problem) {
  int left = 0, stages[6] = {};
  double worst = 0;
  for (int i = 0; i < count; ++i) {
    const ContactProblem p = problem(i);
    const SolveResult r = solve(p, relative(1e-8));
    const double e = worst_residual(p, r.impulse) / fastest(p);
    CHECK((r.status == SolveStatus::kConverged) == (e <= 1e-8));
    left += !(e <= 1e-8);
    worst = std::max(worst, e);
    ++stages[int(r.stage)];
  }
  std::printf(
      "  %-26s unsolved %d of %d, worst %.1e; sweeps %d, Newton %d, proximal %d, interior point "
      "%d, ADMM "
      "%d\n",
      name, left, count, worst, stages[1], stages[2], stages[3], stages[4], stages[5]);
  return left;
}

int unsolved_of_family(const char* family, int count) {
  return unsolved(family, count, [&](int i) { return scenes::random_problem(family, i); });
}

int unsolved_stacks(double ratio, int count) {
  char name[40];
  std::snprintf(name, sizeof name, "stacks, mass ratio %g", ratio);
  return unsolved(name, count, [&](int i) {
    scenes::BoxStackOptions o;
    o.mass_ratio = ratio;
    return scenes::box_stack(i, o);
  });
}

}  // namespace

TEST(ThreeThousandQuadrupedsOnTheirFeetAreSolved) {
  CHECK(unsolved_of_family("quadruped_standing", 1000) == 0);
  CHECK(unsolved_of_family("quadruped_trotting", 1000) == 0);
  CHECK(unsolved_of_family("quadruped_impact", 1000) == 0);
}

TEST(EightThousandProblemsOfEightContactsAreSolved) {
  CHECK(unsolved_of_family("eight_contacts_resting", 4000) == 0);
  CHECK(unsolved_of_family("eight_contacts_impact", 4000) == 0);
}

TEST(ThreeHundredProblemsWithDuplicatedContactsAreSolved) {
  CHECK(unsolved_of_family("duplicated_contacts", 300) == 0);
}

TEST(EightHundredStacksWithMassRatiosUpToTenThousandAreSolved) {
  for (const double ratio : {1.0, 1e2, 1e3, 1e4}) CHECK(unsolved_stacks(ratio, 200) == 0);
}

TEST(StacksWithAMassRatioOfAMillionAreSolvedInNinetySevenOfAHundred) {
  CHECK(unsolved_stacks(1e6, 200) <= 6);
}

TEST(WallsOfFiveHundredContactsAreSolved) {
  const int left = unsolved("walls", 3, [](int i) {
    scenes::BrickWallOptions o;
    o.rows = 12, o.columns = 6;
    return scenes::brick_wall(i, o);
  });
  CHECK(left == 0);
}

TEST(PilesOfAHundredContactsAreSolvedToAMillionth) {
  // Spheres wedge each other; this is where every method has its hard problems.
  int left = 0;
  for (int seed = 0; seed < 6; ++seed) {
    scenes::SpherePileOptions o;
    o.layers = 4;
    const ContactProblem p = scenes::sphere_pile(seed, o);
    left += !(worst_residual(p, solve(p, relative(1e-8)).impulse) <= 1e-6 * fastest(p));
  }
  CHECK(left == 0);
}

TEST(IslandsAreSolvedApart) {
  const ContactProblem hard = heavy_stack(1), easy = scenes::random_problem("quadruped_impact", 1);
  const int first = hard.num_contacts();
  const ContactProblem both = beside(hard, easy);
  const solvers::ExplicitView view(both, {});
  const solvers::Islands islands(view.view);
  CHECK(islands.count() == 2);
  CHECK(int(islands.contacts(0).size()) == first && islands.contacts(1).front() == first);
  SolveOptions o;
  o.tolerance = 1e-10;
  const SolveResult r = solve(both, o), alone = solve(easy, o);
  CHECK(r.status == SolveStatus::kConverged);
  for (int i = 0; i < 3 * easy.num_contacts(); ++i)
    CHECK_NEAR(r.velocity[3 * first + i], alone.velocity[i], 1e-7);
}

TEST(AnIslandThatNothingSolvesDoesNotHoldUpTheOthers) {
  for (int seed = 0; seed < 20; ++seed) {
    const ContactProblem stack = heavy_stack(seed);
    for (const bool jam_first : {true, false}) {
      const ContactProblem both =
          jam_first ? beside(jammed_rail(), stack) : beside(stack, jammed_rail());
      const SolveResult r = solve(both, relative(1e-8));
      CHECK(r.status == SolveStatus::kStalled);
      const int n = stack.num_contacts(), from = jam_first ? 1 : 0;
      for (int i = 0; i < n; ++i) CHECK(r.certificate.residuals[from + i] <= 1e-8 * fastest(both));
    }
  }
}

TEST(TheBriefChainTakesNoMemoryButItsOwn) {
  for (const int contacts : {1, 4, 8, 48}) {
    scenes::BoxStackOptions o;
    o.num_boxes = std::max(1, contacts / 4), o.mass_ratio = 1e4;
    ContactProblem p = contacts == 1 ? jammed_rail() : scenes::box_stack(3, o);
    solvers::ExplicitView e(p, {});
    const int n = p.num_contacts();
    const std::size_t best_bytes = 3 * n * sizeof(double) + 64;
    std::vector<std::byte> block(solvers::brief_chain_bytes(n) + best_bytes);
    std::pmr::monotonic_buffer_resource memory(block.data(), block.size(),
                                               std::pmr::null_memory_resource());
    solvers::BestImpulse best(0, false, nullptr, &memory);
    solvers::Effort effort;
    best.offer(e.view, SolveStage::kStart);
    solvers::run_brief_chain(e.view, best, effort, &memory);  // would throw std::bad_alloc
    CHECK(effort.newton_steps > 0 && effort.interior_point_steps > 0);
  }
}

TEST(WhatNothingSolvesIsNoWorseThanNoImpulse) {
  const ContactProblem p = jammed_rail();
  const SolveResult r = solve(p);
  CHECK(r.status == SolveStatus::kStalled);
  CHECK(r.certificate.residual <= worst_residual(p, {0, 0, 0}));
}

TEST(FullProblemsThatNothingSolvesEndInTime) {
  // Work is bounded by the size of the problem: 80 jammed contacts that all couple.
  scenes::Random rng(5);
  const int n = 80, m = 3 * n;
  std::vector<double> y(m);
  ContactProblem p{std::vector<double>(m * m), std::vector<double>(m), std::vector<double>(n, 1.1)};
  for (int i = 0; i < n; ++i)
    y[3 * i] = 1.45, y[3 * i + 1] = 0.1 * rng.normal(), y[3 * i + 2] = 0.33;
  for (int i = 0; i < m; ++i) {
    p.free_velocity[i] = rng.normal();
    for (int j = 0; j < m; ++j) p.delassus[i * m + j] = y[i] * y[j];
  }
  const SolveResult r = solve(p);
  CHECK(r.status == SolveStatus::kStalled && r.admm_iterations <= 11000);
}
