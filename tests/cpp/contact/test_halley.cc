// The slip solve of one contact, on 1e5 random problems of each of four families.
#include "check.h"
#include "contact/halley.h"
#include "contact/residual.h"
#include "lane/pack.h"
#include "scenes/contact_families.h"

using namespace stickslip;
using namespace stickslip::contact;
using scenes::ContactFamily;
using scenes::ContactMix;
using scenes::family_name;
using scenes::kContactFamilies;
using scenes::random_contacts;
using scenes::SingleContact;

namespace {

template <class S>
LocalContact<S> make_local(const SingleContact& p) {
  LocalContact<S> k = {};
  k.xx = constant<S>(p.G[0]), k.xy = constant<S>(p.G[1]), k.xz = constant<S>(p.G[2]);
  k.yy = constant<S>(p.G[4]), k.yz = constant<S>(p.G[5]), k.zz = constant<S>(p.G[8]);
  k.mu = constant<S>(p.mu);
  prepare(k);
  return k;
}

double norm(const double* c) { return std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]); }

struct Outcome {
  double velocity[3], impulse[3];
};

template <bool kMaxDissipation>
Outcome solve_one(const SingleContact& p, double tolerance) {
  const LocalContact<double> k = make_local<double>(p);
  Outcome o;
  int evaluations;
  solve_halley<kMaxDissipation>(k, p.c.data(), tolerance, o.impulse, evaluations);
  apply_block(k, o.impulse, o.velocity);
  for (int r = 0; r < 3; ++r) o.velocity[r] += p.c[r];
  return o;
}

/// Kinetic energy of the contact point up to a constant: 1/2 lambda' G lambda + c' lambda.
double energy(const SingleContact& p, const double l[3]) {
  double e = 0;
  for (int i = 0; i < 3; ++i) {
    e += p.c[i] * l[i];
    for (int j = 0; j < 3; ++j) e += 0.5 * l[i] * p.G[3 * i + j] * l[j];
  }
  return e;
}

constexpr int kProblems = 100000;

/// Lanes of S from one problem each; compares bits with the plain scalar of the same precision.
template <bool kMaxDissipation, class S>
long differing_numbers(int problems) {
  using T = Value<S>;
  constexpr int kWidth = ScalarTraits<S>::kWidth;
  long different = 0;
  for (const ContactFamily family : kContactFamilies) {
    const auto all = random_contacts(family, problems, 31);
    for (int n = 0; n + kWidth <= problems; n += kWidth) {
      const SingleContact* p = &all[n];
      LocalContact<S> k = {};
      S c[3], l[3];
      for (int lane = 0; lane < kWidth; ++lane) {
        const auto put = [lane](S& to, double x) { set_lane(to, lane, T(x)); };
        put(k.xx, p[lane].G[0]), put(k.xy, p[lane].G[1]), put(k.xz, p[lane].G[2]);
        put(k.yy, p[lane].G[4]), put(k.yz, p[lane].G[5]), put(k.zz, p[lane].G[8]),
            put(k.mu, p[lane].mu);
        for (int r = 0; r < 3; ++r) put(c[r], p[lane].c[r]);
      }
      prepare(k);
      int evaluations;
      const double tolerance = sizeof(T) == 4 ? 1e-5 : 1e-9;
      solve_halley<kMaxDissipation>(k, c, tolerance, l, evaluations);
      for (int lane = 0; lane < kWidth; ++lane) {
        const LocalContact<T> plain = make_local<T>(p[lane]);
        const T cp[3] = {T(p[lane].c[0]), T(p[lane].c[1]), T(p[lane].c[2])};
        T lp[3];
        solve_halley<kMaxDissipation>(plain, cp, tolerance, lp, evaluations);
        for (int r = 0; r < 3; ++r) {
          const T a = get_lane(l[r], lane);
          different += std::memcmp(&a, &lp[r], sizeof a) != 0;
        }
      }
    }
  }
  return different;
}

}  // namespace

TEST(EveryFamilyOpensSticksAndSlips) {
  for (const ContactFamily family : kContactFamilies) {
    int open = 0, stick = 0, slip = 0, unbounded = 0;
    for (const SingleContact& p : random_contacts(family, kProblems, 7)) {
      const LocalContact<double> k = make_local<double>(p);
      const auto r = reduce(k, p.c[0], p.c[1], p.c[2]);
      r.slip ? ++slip : r.stick ? ++stick : ++open;
      unbounded += r.slip && p.mu * std::hypot(k.wx, k.wy) > 1;
    }
    std::printf("  %-16s open %d, stick %d, slip %d (unbounded conic %d)\n", family_name(family),
                open, stick, slip, unbounded);
    CHECK(open > 0.15 * kProblems);
    CHECK(slip > 0.15 * kProblems);
    CHECK(stick > 0.15 * kProblems);
    if (family == ContactFamily::kIllConditioned) CHECK(unbounded > 0.1 * slip);
  }
}

TEST(CoulombImpulseMeetsItsResidual) {
  for (double tolerance : {1e-6, 1e-10})
    for (const ContactFamily family : kContactFamilies) {
      int failures = 0;
      double worst = 0;
      for (const SingleContact& p : random_contacts(family, kProblems, 7)) {
        const Outcome o = solve_one<false>(p, tolerance);
        const LocalContact<double> k = make_local<double>(p);
        const double e = natural_map_residual(k, o.velocity, o.impulse) / norm(p.c.data());
        worst = std::fmax(worst, e);
        failures += !(e <= (family == ContactFamily::kIllConditioned ? 10 : 2) * tolerance);
      }
      std::printf("  %-16s tolerance %g: worst residual %.1e |c|\n", family_name(family), tolerance,
                  worst);
      CHECK(failures == 0);
    }
}

TEST(MaxDissipationImpulseIsBestOnADenseSearch) {
  for (const ContactFamily family : kContactFamilies) {
    double worst = 0;
    for (const SingleContact& p : random_contacts(family, 2000, 70, ContactMix::kSlipOnly)) {
      const LocalContact<double> k = make_local<double>(p);
      CHECK(reduce(k, p.c[0], p.c[1], p.c[2]).slip);
      const Outcome o = solve_one<true>(p, 1e-10);
      double best = 1e300;
      for (int j = 0; j < 4000; ++j) {
        const double t = j * 6.283185307179586 / 4000, x = std::cos(t), y = std::sin(t);
        const double d = 1 + p.mu * (k.wx * x + k.wy * y);
        if (d <= 0) continue;
        const double z = -p.c[2] * k.inv_zz / d, l[3] = {p.mu * z * x, p.mu * z * y, z};
        best = std::fmin(best, energy(p, l));
      }
      const double e = energy(p, o.impulse);
      worst = std::fmax(worst, (e - best) / (std::fabs(best) + 1e-12));
    }
    CHECK_NEAR(worst, 0, 1e-9);
  }
}

TEST(AxiomsHoldOnRandomProblems) {
  for (const ContactFamily family : kContactFamilies) {
    double cone = 0, normal = 0, complementarity = 0, angle = 0;
    for (const SingleContact& p : random_contacts(family, kProblems, 700)) {
      const Outcome o = solve_one<false>(p, 1e-12);
      const double *l = o.impulse, *v = o.velocity, size = norm(l) + 1e-300,
                   speed = norm(p.c.data());
      const double tangent = std::hypot(l[0], l[1]), sliding = std::hypot(v[0], v[1]);
      cone = std::fmax(cone, (tangent - p.mu * l[2]) / size);
      normal = std::fmax(normal, -v[2] / speed);
      CHECK(l[2] >= 0);
      complementarity = std::fmax(complementarity, std::fabs(l[2] * v[2]) / (size * speed));
      // Sliding friction is opposite to the sliding velocity: |v x lambda| = 0 and v . lambda =
      // -|v||lambda|.
      if (tangent > 1e-9 * size && sliding > 1e-3 * speed) {
        const double cross = std::fabs(v[0] * l[1] - v[1] * l[0]) / (tangent * sliding);
        angle = std::fmax(angle, cross);
        CHECK(v[0] * l[0] + v[1] * l[1] < 0);
      }
    }
    std::printf("  %-16s cone %.1e, v_z %.1e, complementarity %.1e, angle %.1e\n",
                family_name(family), cone, normal, complementarity, angle);
    CHECK(cone < 1e-13);
    CHECK(normal < 1e-9);
    CHECK(complementarity < 1e-9);
    CHECK(angle < 1e-5);
  }
}

TEST(EvaluationsStayFew) {
  for (const ContactFamily family : kContactFamilies) {
    long sum = 0, slips = 0;
    int most = 0;
    for (const SingleContact& p : random_contacts(family, kProblems, 7)) {
      const LocalContact<double> k = make_local<double>(p);
      double l[3];
      int n;
      solve_halley<false>(k, p.c.data(), 1e-6, l, n);
      sum += n, slips += n > 0, most = n > most ? n : most;
    }
    std::printf("  %-16s mean %.2f, most %d\n", family_name(family), double(sum) / slips, most);
    CHECK(sum < 4.5 * slips);
    CHECK(most < 30);
  }
}

TEST(WithoutFrictionTheImpulseIsNormal) {
  for (SingleContact p : random_contacts(ContactFamily::kWishart, 1000, 5)) {
    p.mu = 0;
    const Outcome a = solve_one<false>(p, 1e-9), b = solve_one<true>(p, 1e-9);
    for (const Outcome& o : {a, b}) {
      CHECK(o.impulse[0] == 0 && o.impulse[1] == 0);
      CHECK_NEAR(o.impulse[2], p.c[2] < 0 ? -p.c[2] / p.G[8] : 0, 1e-12);
    }
  }
}

TEST(AContactThatCannotPushCarriesNoImpulse) {
  const SingleContact p = {{1, 0, 0, 0, 1, 0, 0, 0, 0}, {1, 2, -3}, 0.5};
  const Outcome o = solve_one<false>(p, 1e-9);
  for (double x : o.impulse) CHECK(x == 0);
  const SingleContact dead = {{0, 0, 0, 0, 0, 0, 0, 0, 0}, {1, 2, -3}, 0.5};
  for (double x : solve_one<false>(dead, 1e-9).impulse) CHECK(x == 0);
}

TEST(AHingeThatMovesAlongOneLineSticksWithoutNoise) {
  // Rank one and two blocks: v stays in the range of G, the stick impulse has least norm.
  scenes::Random rng(9);
  for (int i = 0; i < 1000; ++i) {
    SingleContact p = {};
    const double y[2][3] = {{rng.normal(), rng.normal(), 1 + rng.uniform()},
                            {rng.normal(), rng.normal(), rng.normal()}};
    const int rank = 1 + i % 2;
    double x[2] = {rng.normal(), rng.normal()};
    for (int r = 0; r < 3; ++r)
      for (int q = 0; q < rank; ++q) {
        p.c[r] += y[q][r] * x[q];
        for (int s = 0; s < 3; ++s) p.G[3 * r + s] += y[q][r] * y[q][s];
      }
    p.mu = 3;
    const Outcome o = solve_one<false>(p, 1e-10);
    CHECK(norm(o.impulse) < 1e4);
    const LocalContact<double> k = make_local<double>(p);
    CHECK_NEAR(natural_map_residual(k, o.velocity, o.impulse), 0, 1e-8);
  }
}

TEST(VisitsConvergeToTheSameImpulse) {
  constexpr int kSlips = 20000;
  for (const ContactFamily family : kContactFamilies) {
    int far = 0;
    for (const SingleContact& p : random_contacts(family, kSlips, 17, ContactMix::kSlipOnly)) {
      const LocalContact<double> k = make_local<double>(p);
      const auto r = reduce(k, p.c[0], p.c[1], p.c[2]);
      CHECK(r.slip);
      double direction[2] = {}, l[3] = {};
      for (int n = 0; n < 8; ++n) visit_slip<false>(k, r, 1e-9 * norm(p.c.data()), direction, l);
      double v[3];
      apply_block(k, l, v);
      for (int q = 0; q < 3; ++q) v[q] += p.c[q];
      far += !(natural_map_residual(k, v, l) < 1e-8 * norm(p.c.data()));
    }
    std::printf("  %-16s not converged after 8 visits: %d of %d\n", family_name(family), far,
                kSlips);
    CHECK(far == 0);
  }
}

TEST(WidthDoesNotChangeBits) {
  CHECK((differing_numbers<false, Pack<double, 4>>(20000)) == 0);
  CHECK((differing_numbers<false, Pack<double, 8>>(20000)) == 0);
  CHECK((differing_numbers<false, Pack<float, 8>>(20000)) == 0);
  CHECK((differing_numbers<false, Pack<float, 16>>(20000)) == 0);
  CHECK((differing_numbers<true, Pack<double, 4>>(20000)) == 0);
  CHECK((differing_numbers<true, Pack<double, 8>>(20000)) == 0);
  CHECK((differing_numbers<true, Pack<float, 8>>(20000)) == 0);
  CHECK((differing_numbers<true, Pack<float, 16>>(20000)) == 0);
}

TEST(FloatMeetsItsPrecision) {
  for (const ContactFamily family : kContactFamilies) {
    if (family == ContactFamily::kIllConditioned) continue;
    int failures = 0;
    for (const SingleContact& p : random_contacts(family, 20000, 7)) {
      const LocalContact<float> k = make_local<float>(p);
      const float c[3] = {float(p.c[0]), float(p.c[1]), float(p.c[2])};
      float l[3], v[3];
      int n;
      solve_halley<false>(k, c, 1e-5, l, n);
      apply_block(k, l, v);
      for (int r = 0; r < 3; ++r) v[r] += c[r];
      failures += !(natural_map_residual(k, v, l) < 2e-4 * norm(p.c.data()));
    }
    std::printf("  %-16s above 2e-4: %d\n", family_name(family), failures);
    CHECK(failures <= 60);
  }
}
