// The factored solver on random contacts of a quadruped: 4 feet, feet and torso corners, soles with
// several contacts.
#include <algorithm>
#include <cstdlib>
#include <memory>
#include <vector>

#include "check.h"
#include "contact/owned_problem.h"
#include "contact/robot_problems.h"

using namespace stickslip;
using namespace stickslip::contact;
using namespace problems;

namespace {

/// Plain per-contact iteration on the dense operator, every visit solved to convergence: the slow
/// reference.
std::vector<double> dense_sweeps(const RobotProblem& p, int sweeps) {
  std::vector<double> l(3 * p.n), x(18);
  for (int s = 0; s < sweeps; ++s)
    for (int i = 0; i < p.n; ++i) {
      LocalContact<double> k = {};
      double g[3][3] = {}, c[3], next[3];
      for (int r = 0; r < 3; ++r)
        for (int q = 0; q < 3; ++q)
          for (int j = 0; j < 18; ++j) g[r][q] += p.y[i][r][j] * p.y[i][q][j];
      k.xx = g[0][0], k.xy = g[0][1], k.xz = g[0][2], k.yy = g[1][1], k.yz = g[1][2],
      k.zz = g[2][2], k.mu = p.mu;
      prepare(k);
      for (int r = 0; r < 3; ++r) {
        c[r] = p.c0[i][r];
        for (int j = 0; j < 18; ++j) c[r] += p.y[i][r][j] * x[j];
        for (int q = 0; q < 3; ++q) c[r] -= g[r][q] * l[3 * i + q];
      }
      int evaluations;
      solve_halley<false>(k, c, 1e-13, next, evaluations);
      for (int r = 0; r < 3; ++r) {
        for (int j = 0; j < 18; ++j) x[j] += p.y[i][r][j] * (next[r] - l[3 * i + r]);
        l[3 * i + r] = next[r];
      }
    }
  return l;
}

/// Except that an impulse of zero may have either sign: which visits a sweep skips depends on the
/// other lanes (docs/limits.md).
template <class S>
bool same_bits(S a, S b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (a == 0 && b == 0);
}

/// Solves the problems in lanes and one by one with the same options; counts impulses and shared
/// velocities that differ.
template <class S>
long differing_numbers(int scene, int problems, FactoredOptions options) {
  using T = Value<S>;
  constexpr int kWidth = ScalarTraits<S>::kWidth;
  Owned<S> wide;
  Owned<T> plain;
  Random rng(900 + scene);
  long different = 0;
  for (int n = 0; n < problems; n += kWidth) {
    RobotProblem p[kWidth];
    for (int lane = 0; lane < kWidth; ++lane) {
      do p[lane] = random_robot_problem(scene, rng);
      while (p[lane].n != p[0].n);  // `fill` gives all lanes the same contacts
      fill(wide.p, p[lane], lane);
    }
    solve_factored(wide.p, options);
    for (int lane = 0; lane < kWidth; ++lane) {
      fill(plain.p, p[lane], 0);
      solve_factored(plain.p, options);
      for (int i = 0; i < p[lane].n; ++i)
        for (int r = 0; r < 3; ++r)
          different += !same_bits(get_lane(wide.p.impulse(i)[r], lane), plain.p.impulse(i)[r]);
      for (int k = 0; k < p[lane].m; ++k)
        different += !same_bits(get_lane(wide.p.w[k], lane), plain.p.w[k]);
    }
  }
  return different;
}

}  // namespace

TEST(RobotProblemsAreSolvedTo1e8) {
  // Shares of problems above 1e-8 m/s; cold start, impacts of 3 m/s with random joint velocities.
  const int problems = 4000, allowed[kNumScenes] = {0, 0, 0, 0, 0, 8, 4};
  Owned<double> f;
  for (int scene = 0; scene < kNumScenes; ++scene) {
    Random rng(100 + scene);
    int above = 0, sweeps = 0, newton = 0, fallbacks = 0;
    for (int n = 0; n < problems; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      fill(f.p, p, 0);
      const auto info = solve_factored(f.p);
      const double dense = dense_residual(f.p, p, 0);
      above += !info.converged;
      sweeps += info.sweeps, newton += info.newton_steps, fallbacks += info.fallbacks;
      CHECK(info.converged == (info.residual <= 1e-8));
      CHECK(std::fabs(dense - info.residual) <
            1e-9 + 1e-6 * dense);  // the certificate is the dense residual
    }
    std::printf("  %-26s above 1e-8: %d of %d; sweeps %.2f, Newton steps %.2f, fallbacks %.2f %%\n",
                scene_name(scene), above, problems, double(sweeps) / problems,
                double(newton) / problems, 100.0 * fallbacks / problems);
    CHECK(above <= allowed[scene]);
  }
}

TEST(SweepsThatWouldChangeNothingAreForeseenAndResumedWhereTheyWould) {
  // Each problem with and without foresight.
  Owned<double> f;
  long sweeps[2] = {}, fallbacks[2] = {}, resumed = 0;
  for (int scene = 0; scene < kNumScenes; ++scene) {
    Random rng(700 + scene);
    for (int n = 0; n < 2000; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      for (const bool foresee : {false, true}) {
        FactoredOptions o;
        o.foresee = foresee;
        fill(f.p, p, 0);
        const auto info = solve_factored(f.p, o);
        sweeps[foresee] += info.sweeps, fallbacks[foresee] += info.fallbacks;
        resumed += info.resumed;
        CHECK(foresee || info.resumed == 0);
      }
    }
  }
  std::printf("  sweeps %ld, foreseen %ld; resumed %ld; fallbacks %ld, foreseen %ld\n", sweeps[0],
              sweeps[1], resumed, fallbacks[0], fallbacks[1]);
  CHECK(sweeps[1] < sweeps[0]);
  CHECK(resumed > 0);
  CHECK(fallbacks[1] <= fallbacks[0] + fallbacks[0] / 10);
}

TEST(AFinerToleranceIsMetWhereTheCertificateIsAsked) {
  // By itself it would be content with 1e-3 of the allowed residual, 1e-11 m/s.
  Owned<double> f;
  for (const bool fine : {false, true}) {
    FactoredOptions o;
    o.foresee = false;
    if (fine) o.tolerance_absolute = 1e-12, o.tolerance_relative = 0;
    std::vector<double> residuals;
    for (int scene = 0; scene < kNumScenes; ++scene) {
      Random rng(500 + scene);
      for (int n = 0; n < 1000; ++n) {
        const RobotProblem p = random_robot_problem(scene, rng);
        fill(f.p, p, 0);
        const auto info = solve_factored(f.p, o);
        if (info.newton_steps > 0 && info.fallbacks == 0) residuals.push_back(info.residual);
      }
    }
    std::sort(residuals.begin(), residuals.end());
    const double most = residuals[residuals.size() * 99 / 100];
    std::printf("  %s tolerance: 99 %% of %zu residuals below %.1e\n", fine ? "fine" : "default",
                residuals.size(), most);
    CHECK(fine ? most < 1e-12 : most > 1e-12);
  }
}

TEST(FactoredEqualsDenseSweeps) {
  Owned<double> f;
  for (int scene : {kStand, kImpact}) {
    Random rng(300 + scene);
    for (int n = 0; n < 500; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      fill(f.p, p, 0);
      solve_factored(f.p);
      const auto reference = dense_sweeps(p, 300);
      double x[18] = {};
      for (int i = 0; i < p.n; ++i)
        for (int r = 0; r < 3; ++r)
          for (int j = 0; j < 18; ++j)
            x[j] += p.y[i][r][j] * (f.p.impulse(i)[r] - reference[3 * i + r]);
      // The velocity of the joints is unique; impulses of redundant contacts are not.
      for (double d : x) CHECK_NEAR(d, 0, 1e-6);
    }
  }
}

TEST(ImpulsesObeyTheAxioms) {
  Owned<double> f;
  for (int scene = 0; scene < kNumScenes; ++scene) {
    Random rng(500 + scene);
    for (int n = 0; n < 1000; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      fill(f.p, p, 0);
      if (!solve_factored(f.p).converged) continue;
      for (int i = 0; i < p.n; ++i) {
        const double *l = f.p.impulse(i), *v = f.p.velocity(i), tangent = std::hypot(l[0], l[1]);
        CHECK(l[2] >= 0);
        CHECK(tangent <= p.mu * l[2] * (1 + 1e-12) + 1e-300);
        CHECK(v[2] > -2e-8);
        const double sliding = std::hypot(v[0], v[1]);
        if (sliding > 1e-3 && tangent * f.p.contact(i).local.scale > 1e-3) {
          CHECK(v[0] * l[0] + v[1] * l[1] < 0);
          CHECK(std::fabs(v[0] * l[1] - v[1] * l[0]) < 1e-3 * sliding * tangent);
        }
      }
    }
  }
}

TEST(EnergyNeverGrows) {
  // lambda . (v + v_free) / 2 <= 0 under either law (no restitution).
  Owned<double> f;
  for (bool law : {false, true}) {
    FactoredOptions o;
    o.max_dissipation = law;
    Random rng(600);
    for (int n = 0; n < 1000; ++n) {
      const RobotProblem p = random_robot_problem(kImpact, rng);
      fill(f.p, p, 0);
      if (!solve_factored(f.p, o).converged) continue;
      double gain = 0, size = 0;
      for (int i = 0; i < p.n; ++i)
        for (int r = 0; r < 3; ++r) {
          gain += 0.5 * f.p.impulse(i)[r] * (f.p.velocity(i)[r] + p.c0[i][r]);
          size += std::fabs(f.p.impulse(i)[r]);
        }
      CHECK(gain <= 1e-7 * size);
    }
  }
}

TEST(MaxDissipationSweepsReachTheirFixedPoint) {
  Owned<double> f;
  FactoredOptions o;
  o.max_dissipation = true;
  for (int scene : {kStand, kImpact, kRestEight, kDropEight}) {
    Random rng(700 + scene);
    int above = 0;
    for (int n = 0; n < 1000; ++n) {
      fill(f.p, random_robot_problem(scene, rng), 0);
      above += !solve_factored(f.p, o).converged;
    }
    std::printf("  %-26s above 1e-8: %d of 1000\n", scene_name(scene), above);
    CHECK(above <= (scene < kRestEight ? 0 : 20));
  }
}

TEST(WarmStartNeedsOneSweep) {
  Owned<double> f;
  for (int scene : {kStand, kImpact}) {
    Random rng(800 + scene);
    for (int n = 0; n < 500; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      fill(f.p, p, 0);
      if (!solve_factored(f.p).converged) continue;
      double kept[12][3];
      for (int i = 0; i < p.n; ++i) std::memcpy(kept[i], f.p.impulse(i), sizeof kept[i]);
      fill(f.p, p, 0);
      for (int i = 0; i < p.n; ++i) std::memcpy(f.p.impulse(i), kept[i], sizeof kept[i]);
      const auto info = solve_factored(f.p);
      CHECK(info.sweeps <= 2);
      CHECK(info.converged);
    }
  }
}

TEST(WidthDoesNotChangeBits) {
  FactoredOptions whole, sweeps;
  sweeps.fallback = false;
  for (int scene = 0; scene < kNumScenes; ++scene) {
    CHECK((differing_numbers<Pack<double, 4>>(scene, 400, whole)) == 0);
    CHECK((differing_numbers<Pack<double, 8>>(scene, 400, whole)) == 0);
    const FactoredOptions single = default_options<float>();
    CHECK((differing_numbers<Pack<float, 8>>(scene, 400, single)) == 0);
    CHECK((differing_numbers<Pack<float, 16>>(scene, 400, single)) == 0);
  }
  sweeps.max_dissipation = true;
  CHECK((differing_numbers<Pack<double, 4>>(kImpact, 400, sweeps)) == 0);
}

TEST(UnrolledAndIndexedPathsGiveTheSameBits) {
  Owned<double> a, b;
  const int all[6] = {0, 1, 2, 3, 4, 5};
  for (int scene : {kStand, kImpact, kDropEight}) {
    Random rng(1000 + scene);
    for (int n = 0; n < 500; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      fill(a.p, p, 0);
      fill(b.p, p, 0);
      for (int i = 0; i < p.n; ++i) b.p.set_index(i, all, 6);
      CHECK(a.p.six() && !b.p.six());
      solve_factored(a.p);
      solve_factored(b.p);
      for (int i = 0; i < p.n; ++i)
        for (int r = 0; r < 3; ++r) CHECK(same_bits(a.p.impulse(i)[r], b.p.impulse(i)[r]));
    }
  }
}

TEST(LanesWithoutAContactAreUntouchedByIt) {
  using S = Pack<double, 4>;
  Owned<S> wide;
  Owned<double> plain;
  Random rng(1100);
  for (int n = 0; n < 200; ++n) {
    // Lane 2 has only the first two contacts; what its other slots hold is garbage.
    RobotProblem p = random_robot_problem(kImpact, rng);
    for (int lane = 0; lane < 4; ++lane) fill(wide.p, p, lane);
    for (int i = 2; i < 4; ++i) {
      S one(1.0);
      set_lane(one, 2, 0.0);
      wide.p.active(i) = one > S(0.5);
      set_lane(wide.p.offset(i)[2], 2, __builtin_nan(""));
      set_lane(wide.p.impulse(i)[0], 2, 1e300);
    }
    const auto info = solve_factored(wide.p);
    p.n = 2;
    fill(plain.p, p, 0);
    const auto single = solve_factored(plain.p);
    CHECK(same_bits(get_lane(info.residual, 2), single.residual));
    for (int i = 0; i < 2; ++i)
      for (int r = 0; r < 3; ++r)
        CHECK(same_bits(get_lane(wide.p.impulse(i)[r], 2), plain.p.impulse(i)[r]));
    for (int i = 2; i < 4; ++i)
      for (int r = 0; r < 3; ++r) CHECK(get_lane(wide.p.impulse(i)[r], 2) == 0);
  }
}

TEST(FloatMeetsItsPrecision) {
  Owned<float> f;
  for (int scene = 0; scene <= kDropEight; ++scene) {
    Random rng(1200 + scene);
    int above = 0;
    double worst = 0;
    for (int n = 0; n < 2000; ++n) {
      const RobotProblem p = random_robot_problem(scene, rng);
      fill(f.p, p, 0);
      above += !solve_factored(f.p).converged;
      worst = std::fmax(worst, dense_residual(f.p, p, 0));
    }
    std::printf("  %-26s not converged: %d of 2000, worst residual %.1e\n", scene_name(scene),
                above, worst);
    CHECK(above <= 10);
  }
}

TEST(NonFiniteInputGivesZeroImpulsesAndSaysSo) {
  Owned<double> f;
  Random rng(1300);
  const RobotProblem p = random_robot_problem(kImpact, rng);
  for (int where = 0; where < 3; ++where) {
    fill(f.p, p, 0);
    if (where == 0) f.p.offset(1)[0] = __builtin_nan("");
    if (where == 1) f.p.impulse(2)[2] = __builtin_inf();
    if (where == 2) f.p.private_block(3)[0] = __builtin_nan("");
    const auto info = solve_factored(f.p);
    CHECK(!info.converged);
    for (int i = 0; i < p.n; ++i)
      for (int r = 0; r < 3; ++r) CHECK(f.p.impulse(i)[r] == 0);
    for (int k = 0; k < 6; ++k) CHECK(f.p.w[k] == 0);
  }
}

TEST(DuplicatedContactsAreSolved) {
  Owned<double> f;
  Random rng(1400);
  int above = 0;
  for (int n = 0; n < 500; ++n) {
    // One floating body on four points, each twice: base columns only, velocities in their range.
    RobotProblem p = random_robot_problem(kImpact, rng);
    double x[6];
    for (double& q : x) q = rng.normal() * 5;
    for (int i = 0; i < 4; ++i)
      for (int r = 0; r < 3; ++r) {
        for (int k = 6; k < 18; ++k) p.y[i][r][k] = 0;
        p.c0[i][r] = 0;
        for (int k = 0; k < 6; ++k) p.c0[i][r] += p.y[i][r][k] * x[k];
        std::memcpy(p.y[4 + i][r], p.y[i][r], sizeof p.y[i][r]);
        p.c0[4 + i][r] = p.c0[i][r];
      }
    p.n = 8;
    fill(f.p, p, 0);
    above += !solve_factored(f.p).converged;
  }
  std::printf("  above 1e-8: %d of 500\n", above);
  CHECK(above <= 5);
}
