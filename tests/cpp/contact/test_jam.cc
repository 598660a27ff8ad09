// Contacts without a finite solution (Painleve: mu |w| > 1 on a body held by one joint), and
// friction beyond all bounds, in the factored form of a step.
#include <cstdlib>
#include <memory>

#include "check.h"
#include "contact/factored.h"
#include "contact/owned_problem.h"
#include "scenes/random.h"

using namespace stickslip;
using namespace stickslip::contact;
using scenes::Random;

namespace {

/// A planar arm of `dofs` joints (1 or 2) with `n` points on the ground, driven at it: v = Y q.
struct Arm {
  int n, dofs;
  double y[2][3][2], offset[2][3], mu;
  bool planar_jam() const {  // of the first contact
    return dofs == 1 && mu * std::fabs(y[0][0][0]) > std::fabs(y[0][2][0]);
  }
};
Arm random_arm(Random& rng, int n, int dofs) {
  Arm a{};
  a.n = n, a.dofs = dofs, a.mu = 0.8;
  double rate[2] = {rng.normal(), rng.normal()};
  for (int i = 0; i < n; ++i) {
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < dofs; ++k) {
        a.y[i][r][k] = r == 1 ? 0 : rng.normal();
        // The contact can push.
        if (r == 2) a.y[i][r][k] += std::copysign(0.05, a.y[i][r][k]);
        a.offset[i][r] += a.y[i][r][k] * rate[k];
      }
    // What restitution or a gap adds: not in the range of Y.
    a.offset[i][2] += rng.uniform(-0.5, 0.5);
  }
  return a;
}
template <class S>
void fill(FactoredProblem<S>& p, const Arm& a, int lane) {
  using T = Value<S>;
  if (lane == 0) {
    p.clear(a.dofs);
    for (int i = 0; i < a.n; ++i) p.add();
  }
  for (int i = 0; i < a.n; ++i) {
    for (int k = 0; k < a.dofs; ++k) {
      S row[3] = {};
      if (lane > 0) store(p.y(i)[k], row);
      for (int r = 0; r < 3; ++r) set_lane(row[r], lane, T(a.y[i][r][k]));
      p.y(i)[k] = make_row3(row[0], row[1], row[2]);
    }
    for (int r = 0; r < 3; ++r) set_lane(p.offset(i)[r], lane, T(a.offset[i][r]));
    set_lane(p.friction(i), lane, T(a.mu));
  }
}
double speed(const Arm& a) {
  double most = 0;
  for (int i = 0; i < a.n; ++i) {
    const double* c = a.offset[i];
    most = std::fmax(most, std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]));
  }
  return most;
}

}  // namespace

TEST(AJamIsBoundedDoesNotSinkAndIsNotCalledSolved) {
  Owned<double> f;
  for (const bool max_dissipation : {false, true})
    for (const int dofs : {1, 2}) {
      FactoredOptions o;
      o.max_dissipation = max_dissipation;
      Random rng(70 + dofs);
      int jams = 0, unsolved = 0;
      double most = 0;
      for (int n = 0; n < 2000; ++n) {
        const Arm a = random_arm(rng, 1, dofs);
        fill(f.p, a, 0);
        const auto info = solve_factored(f.p, o);
        const double *l = f.p.impulse(0), *v = f.p.velocity(0),
                     size = f.p.contact(0).local.scale * std::hypot(l[0], l[1], l[2]);
        // Solved, it may be as large as it has to be.
        CHECK(info.converged || size <= 1.0001e6 * speed(a));
        CHECK(v[2] >= -2e-3 * speed(a));
        CHECK(std::isfinite(info.residual));
        if (!info.converged) most = std::fmax(most, size / speed(a));
        jams += a.planar_jam(), unsolved += !info.converged;
        if (!max_dissipation && dofs == 1 && !a.planar_jam()) CHECK(info.converged);
      }
      std::printf(
          "  law %d, %d joints: jams possible %d, not solved %d of 2000; impulses up to %.1e\n",
          max_dissipation, dofs, jams, unsolved, most);
    }
}

TEST(TwoPointsOnOneJointAreBoundedToo) {
  Owned<double> f;
  for (const int dofs : {1, 2}) {
    Random rng(80 + dofs);
    int unsolved = 0;
    double most = 0;
    for (int n = 0; n < 1000; ++n) {
      const Arm a = random_arm(rng, 2, dofs);
      fill(f.p, a, 0);
      const auto info = solve_factored(f.p);
      unsolved += !info.converged;
      for (int i = 0; i < 2; ++i) {
        const double* l = f.p.impulse(i);
        const double size = f.p.contact(i).local.scale * std::hypot(l[0], l[1], l[2]);
        // Solved, it may be as large as it has to be.
        CHECK(info.converged || size <= 1.0001e6 * speed(a));
        if (!info.converged) most = std::fmax(most, size / speed(a));
      }
    }
    std::printf("  %d joints: not solved %d of 1000; impulses up to %.1e\n", dofs, unsolved, most);
  }
}

TEST(AJamInOneLaneHasTheBitsOfThePlainSolve) {
  using S = Pack<double, 4>;
  Owned<S> wide;
  Owned<double> plain;
  for (const bool max_dissipation : {false, true}) {
    FactoredOptions o;
    o.max_dissipation = max_dissipation;
    Random rng(90);
    for (int n = 0; n < 300; ++n) {
      Arm a[4];
      for (int lane = 0; lane < 4; ++lane) fill(wide.p, a[lane] = random_arm(rng, 2, 1), lane);
      solve_factored(wide.p, o);
      for (int lane = 0; lane < 4; ++lane) {
        fill(plain.p, a[lane], 0);
        solve_factored(plain.p, o);
        for (int i = 0; i < 2; ++i)
          for (int r = 0; r < 3; ++r)
            CHECK(get_lane(wide.p.impulse(i)[r], lane) == plain.p.impulse(i)[r]);
        CHECK(get_lane(wide.p.w[0], lane) == plain.p.w[0]);
      }
    }
  }
}

TEST(JamsInFloatAreBoundedToo) {
  Owned<float> f;
  Random rng(95);
  for (int n = 0; n < 1000; ++n) {
    const Arm a = random_arm(rng, 1, 1);
    fill(f.p, a, 0);
    solve_factored(f.p);
    for (int r = 0; r < 3; ++r) CHECK(std::isfinite(f.p.impulse(0)[r]));
    CHECK(f.p.velocity(0)[2] >= -2e-3 * speed(a) - 1e-4);
  }
}

TEST(InfiniteFrictionCountsAs1e4) {
  Owned<double> f;
  Random rng(97);
  for (int n = 0; n < 500; ++n) {
    // A free point: whatever hits the ground with 1 m/s sideways sticks.
    double impulse[3] = {};
    for (const double mu : {kMaxFriction, 1e6, 1e300, double(INFINITY)}) {
      f.p.clear(3);
      f.p.add();
      Random same(1000 + n);
      for (int k = 0; k < 3; ++k)
        f.p.y(0)[k] = make_row3(same.normal(), same.normal(), same.normal());
      f.p.offset(0)[0] = 1, f.p.offset(0)[2] = same.uniform(-1, 0.1);
      f.p.friction(0) = mu;
      const auto info = solve_factored(f.p);
      CHECK(std::isfinite(info.residual));
      for (int r = 0; r < 3; ++r) {
        if (mu == kMaxFriction) impulse[r] = f.p.impulse(0)[r];
        CHECK(f.p.impulse(0)[r] == impulse[r]);
      }
    }
  }
}
