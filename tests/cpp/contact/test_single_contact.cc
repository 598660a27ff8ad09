// Every single-contact method on 1e5 random problems of each of four families.
//
// Oracles: for maximum dissipation a dense search over the angle of the sliding impulse, refined
// with energy values in long double (no gradient, no quartic); for Coulomb's law the natural map.
// Failures are counted, not skipped.
#include "check.h"
#include "contact/residual.h"
#include "contact/single.h"
#include "scenes/contact_families.h"

using namespace stickslip;
using contact::LocalContact;
using contact::Method;
using scenes::ContactFamily;
using scenes::SingleContact;

namespace {

constexpr int kCount = 100000;
constexpr ContactFamily kFamilies[] = {ContactFamily::kNearDiagonal, ContactFamily::kWishart,
                                       ContactFamily::kRobotFoot, ContactFamily::kIllConditioned};
constexpr const char* kMethodNames[] = {"halley", "bisection", "golden_section", "quartic"};

LocalContact<double> local(const SingleContact& p) {
  LocalContact<double> k;
  k.xx = p.G[0], k.xy = p.G[1], k.xz = p.G[2], k.yy = p.G[4], k.yz = p.G[5], k.zz = p.G[8],
  k.mu = p.mu;
  contact::prepare(k);
  return k;
}
void velocity(const SingleContact& p, const double lambda[3], double v[3]) {
  for (int i = 0; i < 3; ++i)
    v[i] =
        p.c[i] + p.G[3 * i] * lambda[0] + p.G[3 * i + 1] * lambda[1] + p.G[3 * i + 2] * lambda[2];
}
double norm(const double v[3]) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/// Least energy over the conic by search alone; also returns the impulse.
struct Search {
  long double energy, lambda[3];
};
Search brute_force(const SingleContact& p) {
  using Real = long double;
  const auto& G = p.G;
  const Real a = -Real(p.c[2]) / G[8], wx = Real(G[2]) / G[8], wy = Real(G[5]) / G[8];
  const Real sxx = G[0] - G[2] * wx, sxy = G[1] - G[2] * wy, syy = G[4] - G[5] * wy;
  const Real bx = p.c[0] + G[2] * a, by = p.c[1] + G[5] * a;
  const auto energy = [&](Real angle, Real* lambda) -> Real {
    const Real x = std::cos(angle), y = std::sin(angle), d = 1 + p.mu * (wx * x + wy * y);
    if (d <= 0) return 1e300L;
    const Real r = p.mu * a / d, lx = r * x, ly = r * y;
    if (lambda) lambda[0] = lx, lambda[1] = ly, lambda[2] = r / p.mu;
    return (sxx * lx * lx + syy * ly * ly) / 2 + sxy * lx * ly + bx * lx + by * ly;
  };
  // Dense grid in double.
  constexpr int kGrid = 720;
  static std::vector<double> cosines, sines;
  if (cosines.empty())
    for (int i = 0; i < kGrid; ++i)
      cosines.push_back(std::cos(2 * M_PI * i / kGrid)),
          sines.push_back(std::sin(2 * M_PI * i / kGrid));
  const double Wx = p.mu * double(wx), Wy = p.mu * double(wy), ma = p.mu * double(a), Sxx = sxx,
               Sxy = sxy, Syy = syy, Bx = bx, By = by;
  double best = 1e300;
  int at = 0;
  for (int i = 0; i < kGrid; ++i) {
    const double d = 1 + Wx * cosines[i] + Wy * sines[i];
    const double lx = ma / d * cosines[i], ly = ma / d * sines[i];
    const double e =
        d > 0 ? 0.5 * (Sxx * lx * lx + Syy * ly * ly) + Sxy * lx * ly + Bx * lx + By * ly : 1e300;
    if (e < best) best = e, at = i;
  }
  // Golden section between the neighbors of the best grid point.
  const Real ratio = 0.618033988749894848204586834L;
  Real lo = 2 * M_PIl * (at - 1) / kGrid, hi = 2 * M_PIl * (at + 1) / kGrid;
  Real x1 = hi - ratio * (hi - lo), x2 = lo + ratio * (hi - lo), e1 = energy(x1, nullptr),
       e2 = energy(x2, nullptr);
  for (int i = 0; i < 48; ++i) {
    if (e1 < e2)
      hi = x2, x2 = x1, e2 = e1, x1 = hi - ratio * (hi - lo), e1 = energy(x1, nullptr);
    else
      lo = x1, x1 = x2, e1 = e2, x2 = lo + ratio * (hi - lo), e2 = energy(x2, nullptr);
  }
  Search s;
  s.energy = energy((lo + hi) / 2, s.lambda);
  return s;
}

/// (C10) of an impulse, scaled for comparison.
double energy_excess(const SingleContact& p, const double lambda[3], const Search& s) {
  using Real = long double;
  const auto& G = p.G;
  const Real a = -Real(p.c[2]) / G[8], wx = Real(G[2]) / G[8], wy = Real(G[5]) / G[8];
  const Real sxx = G[0] - G[2] * wx, sxy = G[1] - G[2] * wy, syy = G[4] - G[5] * wy;
  const Real bx = p.c[0] + G[2] * a, by = p.c[1] + G[5] * a, lx = lambda[0], ly = lambda[1];
  const Real e = (sxx * lx * lx + syy * ly * ly) / 2 + sxy * lx * ly + bx * lx + by * ly;
  return double(e - s.energy);
}

struct Count {
  int wrong = 0, unconverged = 0, open = 0, stick = 0, slip = 0;
  double evaluations = 0, worst = 0;
};

void print(ContactFamily f, Method m, const char* law, const Count& n) {
  std::printf("  %-15s %-14s %-15s wrong %5d  not converged %5d  evaluations %5.2f  worst %.1e\n",
              scenes::family_name(f), kMethodNames[int(m)], law, n.wrong, n.unconverged,
              n.evaluations / std::max(n.slip, 1), n.worst);
}

/// A slip of the maximum dissipation law is right if it is the brute-force impulse to 10 tolerances
/// (|lambda| is 1 N s), or, where the problem's condition hides that, if its velocity along the
/// conic is within the tolerance and its energy exceeds the search's by no more than that velocity
/// explains.
bool matches(const SingleContact& p, const LocalContact<double>& k, const double lambda[3],
             const Search& s, double tolerance, double& error) {
  const double d[3] = {lambda[0] - double(s.lambda[0]), lambda[1] - double(s.lambda[1]),
                       lambda[2] - double(s.lambda[2])};
  error = norm(d);
  if (error <= 10 * tolerance) return true;
  double v[3], cone = std::hypot(lambda[0], lambda[1]) - p.mu * lambda[2];
  velocity(p, lambda, v);
  const double r = std::hypot(lambda[0], lambda[1]), nx = lambda[0] / r + p.mu * k.wx,
               ny = lambda[1] / r + p.mu * k.wy;
  const double along = std::fabs(v[1] * nx - v[0] * ny) / std::hypot(nx, ny);
  const double allowed = tolerance * (norm(p.c.data()) + 3 * k.scale);
  const double rounding = 1e-15 * norm(p.c.data());  // of the impulse, whose norm is 1
  return energy_excess(p, lambda, s) <= allowed * error + rounding && along <= allowed &&
         std::fabs(v[2]) <= allowed && std::fabs(cone) <= tolerance;
}

template <Method method>
Count run_max_dissipation(const std::vector<SingleContact>& problems,
                          const std::vector<Search>& searches, double tolerance) {
  Count n;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const SingleContact& p = problems[i];
    const LocalContact<double> k = local(p);
    const double stop = method == Method::kHalley ? tolerance * norm(p.c.data()) : tolerance;
    const auto s = contact::solve_single<method, true>(k, p.c.data(), stop);
    const double lambda[3] = {s.x, s.y, s.z};
    double v[3], error = 0;
    velocity(p, lambda, v);
    n.unconverged += !s.converged;
    if (s.evaluations > 0) {
      ++n.slip, n.evaluations += s.evaluations;
      n.wrong += !matches(p, k, lambda, searches[i], tolerance, error);
    } else if (s.z > 0) {
      ++n.stick;
      error = norm(v), n.wrong += !(error <= 1e-9 * (norm(p.c.data()) + k.scale));
    } else {
      ++n.open;
      n.wrong += p.c[2] < 0;
    }
    n.worst = std::fmax(n.worst, error);
  }
  return n;
}

template <Method method>
Count run_coulomb(const std::vector<SingleContact>& problems, double tolerance) {
  Count n;
  for (const SingleContact& p : problems) {
    const LocalContact<double> k = local(p);
    const double speed = norm(p.c.data());
    const double stop = method == Method::kHalley ? tolerance * speed : tolerance;
    const auto s = contact::solve_single<method, false>(k, p.c.data(), stop);
    const double lambda[3] = {s.x, s.y, s.z};
    double v[3];
    velocity(p, lambda, v);
    // The others stop at an impulse, which the block turns into a velocity.
    const double residual = contact::natural_map_residual(k, v, lambda);
    const double allowed =
        method == Method::kHalley ? 2 * tolerance * speed : tolerance * (speed + 3 * k.scale);
    n.unconverged += !s.converged;
    n.wrong += !(residual <= allowed);
    n.worst = std::fmax(n.worst, residual / allowed);
    (s.evaluations > 0 ? n.slip : s.z > 0 ? n.stick : n.open) += 1;
    n.evaluations += s.evaluations;
  }
  return n;
}

bool mixed(const Count& n) {
  const int total = n.open + n.stick + n.slip;
  return total == kCount && n.open >= 0.15 * total && n.stick >= 0.15 * total &&
         n.slip >= 0.15 * total;
}

}  // namespace

TEST(MaxDissipationMatchesBruteForceOnEveryFamily) {
  for (const ContactFamily f : kFamilies) {
    const auto problems = scenes::random_contacts(f, kCount, 1);
    std::vector<Search> searches(problems.size());
    for (std::size_t i = 0; i < problems.size(); ++i)
      if (i % 3 == 2) searches[i] = brute_force(problems[i]);
    for (const double tolerance : {1e-6, 1e-9}) {
      std::printf("  tolerance %g\n", tolerance);
      const Count halley = run_max_dissipation<Method::kHalley>(problems, searches, tolerance);
      const Count bisection =
          run_max_dissipation<Method::kBisection>(problems, searches, tolerance);
      const Count golden =
          run_max_dissipation<Method::kGoldenSection>(problems, searches, tolerance);
      const Count quartic = run_max_dissipation<Method::kQuartic>(problems, searches, tolerance);
      print(f, Method::kHalley, "max_dissipation", halley);
      print(f, Method::kBisection, "max_dissipation", bisection);
      print(f, Method::kGoldenSection, "max_dissipation", golden);
      print(f, Method::kQuartic, "max_dissipation", quartic);
      CHECK(mixed(halley) && mixed(bisection));
      CHECK(halley.wrong == 0 && halley.unconverged == 0);
      CHECK(bisection.wrong == 0 && bisection.unconverged == 0);
    }
  }
}

TEST(CoulombSolutionsHaveNoResidualOnEveryFamily) {
  for (const ContactFamily f : kFamilies) {
    const auto problems = scenes::random_contacts(f, kCount, 2);
    for (const double tolerance : {1e-6, 1e-9}) {
      std::printf("  tolerance %g\n", tolerance);
      const Count halley = run_coulomb<Method::kHalley>(problems, tolerance);
      const Count bisection = run_coulomb<Method::kBisection>(problems, tolerance);
      const Count quartic = run_coulomb<Method::kQuartic>(problems, tolerance);
      print(f, Method::kHalley, "coulomb", halley);
      print(f, Method::kBisection, "coulomb", bisection);
      print(f, Method::kQuartic, "coulomb", quartic);
      CHECK(mixed(halley) && mixed(bisection));
      CHECK(halley.wrong == 0 && halley.unconverged == 0);
      CHECK(bisection.wrong == 0 && bisection.unconverged == 0);
    }
  }
}

TEST(FrictionlessContactTakesANormalImpulseOnly) {
  SingleContact p{{2, 0.5, 0.3, 0.5, 1, -0.2, 0.3, -0.2, 1.5}, {1, -2, -3}, 0};
  const LocalContact<double> k = local(p);
  const auto s = contact::solve_single<Method::kHalley, false>(k, p.c.data(), 1e-12);
  CHECK(s.x == 0 && s.y == 0);
  CHECK_NEAR(s.z, 2, 1e-15);
}

TEST(ContactThatCannotPushStaysWithoutImpulse) {
  SingleContact p{{2, 0.5, 0, 0.5, 1, 0, 0, 0, 0}, {1, -2, -3}, 0.5};
  const LocalContact<double> k = local(p);
  const auto s = contact::solve_single<Method::kBisection, true>(k, p.c.data(), 1e-12);
  CHECK(s.x == 0 && s.y == 0 && s.z == 0);
}

TEST(SlidingOnAnIsotropicBlockStartsAtTheSolution) {
  // w = 0 and S a multiple of 1: friction is opposite to c_T, and the paper's start is the answer.
  SingleContact p{{2, 0, 0, 0, 2, 0, 0, 0, 1}, {3, 4, -1}, 0.5};
  const LocalContact<double> k = local(p);
  const auto check = [](const contact::SlipSolution& s) {
    CHECK(s.converged);
    CHECK_NEAR(s.x, -0.3, 1e-7);
    CHECK_NEAR(s.y, -0.4, 1e-7);
    CHECK_NEAR(s.z, 1, 1e-7);
  };
  check(contact::solve_single<Method::kHalley, false>(k, p.c.data(), 1e-9));
  check(contact::solve_single<Method::kHalley, true>(k, p.c.data(), 1e-9));
  check(contact::solve_single<Method::kBisection, false>(k, p.c.data(), 1e-9));
  check(contact::solve_single<Method::kBisection, true>(k, p.c.data(), 1e-9));
  check(contact::solve_single<Method::kGoldenSection, true>(k, p.c.data(), 1e-7));
}

TEST(QuarticSaysWhenItFails) {
  // The isotropic block makes the leading coefficient vanish: no closed form, and it says so.
  SingleContact p{{2, 0, 0, 0, 2, 0, 0, 0, 1}, {3, 4, -1}, 0.5};
  const auto s = contact::solve_single<Method::kQuartic, true>(local(p), p.c.data(), 1e-9);
  CHECK(!s.converged);
  CHECK(std::isfinite(s.x) && std::isfinite(s.y) && std::isfinite(s.z));
}

namespace {

/// One contact on a body with one or two degrees of freedom: G = sum_k t_k t_k^T, c in its range,
/// `shifted`: plus an allowed approach. Planar: nothing moves along y, so S is 0 up to rounding.
SingleContact random_rail(scenes::Random& rng, bool planar, int rank, bool shifted, double mu) {
  SingleContact p{};
  p.mu = mu;
  for (int k = 0; k < rank; ++k) {
    const double t[3] = {rng.normal(), planar ? 0 : rng.normal(), rng.normal()},
                 along = rng.normal();
    for (int a = 0; a < 3; ++a) {
      p.c[a] += t[a] * along;
      for (int b = 0; b < 3; ++b) p.G[3 * a + b] += t[a] * t[b];
    }
  }
  if (shifted) p.c[2] += rng.normal();
  return p;
}

struct RailCounts {
  long infinite = 0, wrong = 0, failed = 0;
};

/// Solves by one method and law; a claim of convergence is checked. A failure counts unless the
/// contact may jam.
template <Method method, bool kMaxDissipation>
void check_rail(const SingleContact& p, RailCounts& counts) {
  const LocalContact<double> k = local(p);
  const double speed = norm(p.c.data());
  const auto s =
      contact::solve_single<method, kMaxDissipation>(k, p.c.data(),
                                                     method == Method::kHalley ? 1e-10 * speed
                                                     : method == Method::kGoldenSection ? 1e-6
                                                                                        : 1e-10);
  const double l[3] = {s.x, s.y, s.z};
  double v[3];
  velocity(p, l, v);
  counts.infinite += !std::isfinite(norm(l));
  const double outside = std::fmax(0, std::hypot(s.x, s.y) - p.mu * s.z * (1 + 1e-9)) * k.scale;
  const double error =
      kMaxDissipation ? outside + std::fmax(0, -v[2]) : contact::natural_map_residual(k, v, l);
  const double rounding = contact::impulse_rounding(k, l);  // of impulses 1e11 times the velocity
  counts.wrong += s.converged && !(error <= 1e-7 * speed * (1 + p.mu) + rounding);
  counts.failed += !s.converged && p.mu * std::hypot(p.G[2], p.G[5]) < p.G[8];
}

}  // namespace

TEST(SingularBlocksGiveFiniteImpulsesAndNoFalseClaims) {
  RailCounts halley, bisection, golden, quartic;
  for (int kind = 0; kind < 8; ++kind)
    for (const double mu : {0.0, 0.1, 0.8, 3.0, 1e4}) {
      scenes::Random rng(60 + kind);
      for (int i = 0; i < kCount / 10; ++i) {
        const SingleContact p = random_rail(rng, kind & 1, 1 + (kind >> 1 & 1), kind & 4, mu);
        check_rail<Method::kHalley, false>(p, halley);
        check_rail<Method::kHalley, true>(p, halley);
        check_rail<Method::kBisection, false>(p, bisection);
        check_rail<Method::kBisection, true>(p, bisection);
        check_rail<Method::kGoldenSection, true>(p, golden);
        check_rail<Method::kQuartic, false>(p, quartic);
        check_rail<Method::kQuartic, true>(p, quartic);
      }
    }
  for (const RailCounts& c : {halley, bisection, golden, quartic})
    CHECK(c.infinite == 0 && c.wrong == 0);
  // The two others say that they failed, as they may.
  CHECK(halley.failed == 0 && bisection.failed == 0);
}
