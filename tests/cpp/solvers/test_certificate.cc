// The certificate of an impulse against numbers worked out by hand.
#include "check.h"
#include "scenes/problem_families.h"

using namespace stickslip;

namespace {

/// One contact with G = 1: velocities are c + impulse.
Certificate of(const std::vector<double>& velocity, const std::vector<double>& impulse,
               double mu = 0.5) {
  ContactProblem p{{1, 0, 0, 0, 1, 0, 0, 0, 1}, velocity, {mu}};
  for (int i = 0; i < 3; ++i) p.free_velocity[i] -= impulse[i];
  return certify(p, impulse);
}

}  // namespace

TEST(AnExactImpulseHasACertificateOfZeros) {
  // Open and leaving; sticking; sliding along -x under friction along x.
  for (const Certificate& c :
       {of({0.3, 0, 2}, {0, 0, 0}), of({0, 0, 0}, {0.1, 0, 1}), of({-2, 0, 0}, {0.5, 0, 1})}) {
    CHECK(c.residual <= 1e-15 && c.backward_error <= 1e-15 && c.penetration_speed <= 1e-15);
    CHECK(c.cone_violation <= 0 && c.direction_error <= 1e-15 && c.power <= 1e-15);
  }
}

TEST(BackwardErrorsAreTheLeastChangeOfVelocity) {
  // No impulse, sinking at 0.2: only the approach counts, whatever slides.
  CHECK_NEAR(of({5, 5, -0.2}, {0, 0, 0}).backward_error, 0.2, 1e-15);
  // Inside the cone the contact should rest.
  CHECK_NEAR(of({0.3, 0.4, 1.2}, {0.1, 0, 1}).backward_error, 1.3, 1e-15);
  // On the mantle with friction along x: sliding along -x is exact, the rest is not.
  CHECK_NEAR(of({-7, 0.3, 0.4}, {0.5, 0, 1}).backward_error, 0.5, 1e-15);
  // Sliding the wrong way: the nearest exact velocity is none.
  CHECK_NEAR(of({3, 0, 4}, {0.5, 0, 1}).backward_error, 5, 1e-14);
  // Without friction any sliding is exact.
  CHECK_NEAR(of({3, 2, 0.1}, {0, 0, 1}, 0).backward_error, 0.1, 1e-15);
}

TEST(PartsOfACertificateMeasureWhatTheyName) {
  CHECK_NEAR(of({0, 0, -0.7}, {0, 0, 0}).penetration_speed, 0.7, 1e-15);
  CHECK_NEAR(of({0, 0, 0}, {0.8, 0, 1}).cone_violation, 0.3, 1e-15);
  CHECK_NEAR(of({0, -1, 0}, {0.5, 0, 1}).direction_error, std::acos(0.0), 1e-15);
  CHECK_NEAR(of({-std::cos(0.01), -std::sin(0.01), 0}, {0.5, 0, 1}).direction_error, 0.01, 1e-14);
  // An impulse of 1 N s on a contact that leaves at 0.25 m/s.
  CHECK_NEAR(of({0, 0, 0.25}, {0, 0, 1}).power, 0.25, 1e-15);
}

TEST(ASolutionsCertificateIsTheOneOfItsImpulse) {
  for (int seed = 0; seed < 20; ++seed) {
    const ContactProblem p = scenes::random_problem("eight_contacts_impact", seed);
    const SolveResult r = solve(p);
    const Certificate again = certify(p, r.impulse);
    CHECK(again.residuals == r.certificate.residuals);
    CHECK(again.backward_errors == r.certificate.backward_errors);
    CHECK(again.power == r.certificate.power &&
          again.direction_error == r.certificate.direction_error);
    CHECK(residual(p, r.impulse) == r.certificate.residuals);
  }
}

TEST(VelocitiesAreRoundedOnceHoweverLargeTheImpulses) {
  // A light body pressed between heavy ones: 1e8 - 1e8 + 1 is 1 only in twice the precision.
  const int n = 3, m = 9;
  ContactProblem p{std::vector<double>(m * m), std::vector<double>(m), std::vector<double>(n, 0.5)};
  for (int i = 0; i < m; ++i) p.delassus[i * m + i] = 2;
  const auto couple = [&](int a, int b, double g) {
    p.delassus[a * m + b] = p.delassus[b * m + a] = g;
  };
  couple(2, 5, 1), couple(2, 8, -1), couple(5, 8, -0.5);
  const double big = 1e17;
  const std::vector<double> impulse = {0, 0, 1, 0, 0, big, 0, 0, big};
  // v_z of contact 0 = 2 * 1 + 1 * 1e17 - 1 * 1e17 + c = 2 + c; with c = -2 exactly 0.
  p.free_velocity[2] = -2;
  const Certificate c = certify(p, impulse);
  CHECK(c.backward_errors[0] == 0);  // v_z = 0 to the last bit
}

TEST(WhatOverflowsIsInfinitelyWrong) {
  const ContactProblem p{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, -1}, {0.5}};
  const Certificate c = certify(p, {1e200, 0, 1e300});
  CHECK(std::isinf(c.residual) && std::isinf(c.residuals[0]) && !std::isnan(c.backward_error));
}
