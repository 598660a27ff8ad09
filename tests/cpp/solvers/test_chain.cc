// What method "auto" must solve: whole families, each problem from a cold start, to a residual of
// 1e-8 of max|c| by the pure residual function. Counts are those the project promises.
#include <algorithm>

#include "check.h"
#include "scenes/problem_families.h"
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

TEST(ThreeThousandQuadrupedsOnFourFeetAreSolved) {
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

TEST(WallsOfSixHundredContactsAreSolved) {
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
  // A hard stack beside an easy quadruped, as one problem without a coupling block.
  scenes::BoxStackOptions hard;
  hard.num_boxes = 4, hard.mass_ratio = 1e4, hard.heavy = scenes::HeavyBoxes::kTop;
  const ContactProblem a = scenes::box_stack(1, hard),
                       b = scenes::random_problem("quadruped_impact", 1);
  const int na = a.num_contacts(), n = na + b.num_contacts();
  ContactProblem both;
  both.delassus.resize(9 * n * n);
  for (int i = 0; i < 3 * n; ++i)
    for (int j = 0; j < 3 * n; ++j) {
      const bool first = i < 3 * na && j < 3 * na, second = i >= 3 * na && j >= 3 * na;
      if (first) both.delassus[i * 3 * n + j] = a.delassus[i * 3 * na + j];
      if (second)
        both.delassus[i * 3 * n + j] = b.delassus[(i - 3 * na) * 3 * b.num_contacts() + j - 3 * na];
    }
  for (const ContactProblem* p : {&a, &b}) {
    both.free_velocity.insert(both.free_velocity.end(), p->free_velocity.begin(),
                              p->free_velocity.end());
    both.friction.insert(both.friction.end(), p->friction.begin(), p->friction.end());
  }
  const solvers::ExplicitView view(both, std::vector<double>(3 * n));
  const solvers::Islands islands(view.view);
  CHECK(islands.count() == 2);
  CHECK(int(islands.contacts(0).size()) == na && islands.contacts(1).front() == na);
  SolveOptions o;
  o.tolerance = 1e-10;
  const SolveResult r = solve(both, o);
  CHECK(r.status == SolveStatus::kConverged);
  const SolveResult alone = solve(b, o);
  for (int i = 0; i < 3 * b.num_contacts(); ++i)
    CHECK_NEAR(r.velocity[3 * na + i], alone.velocity[i], 1e-7);
}

TEST(WhatNothingSolvesIsNoWorseThanNoImpulse) {
  // A rail that jams: it moves along one line, and friction holds it there while it is driven in.
  const double t[3] = {1.45, 0.54, 0.33};
  ContactProblem p{std::vector<double>(9), {1.0421, -0.6304, -1.0035}, {1.123}};
  for (int k = 0; k < 9; ++k) p.delassus[k] = t[k / 3] * t[k % 3];
  const SolveResult r = solve(p);
  CHECK(r.status == SolveStatus::kStalled);
  CHECK(r.certificate.residual <= worst_residual(p, {0, 0, 0}));
}
