// Per-contact iteration on random quadrupeds: every single-contact method and both laws reach the
// residual.
#include <stickslip/errors.h>

#include "check.h"
#include "contact/dense_problems.h"
#include "contact/per_contact.h"

using namespace stickslip;

namespace {

SolveOptions per_contact_options(SingleContactMethod method, FrictionLaw law, double tolerance) {
  SolveOptions o;
  o.method = SolveMethod::kPerContact, o.single_contact = method, o.law = law,
  o.tolerance = tolerance;
  return o;
}

struct Tally {
  int unconverged = 0, most = 0;
  double sweeps = 0;
};

Tally run(int scene, const SolveOptions& o, int count = 200) {
  problems::Random rng(11 + scene);
  Tally t;
  for (int i = 0; i < count; ++i) {
    const ContactProblem p = problems::dense(problems::random_robot_problem(scene, rng));
    const SolveResult r = solve(p, o);
    t.unconverged += r.status != SolveStatus::kConverged;
    t.sweeps += double(r.sweeps) / count;
    t.most = std::max(t.most, r.sweeps);
    // The status says what the pure function says.
    const double e = problems::largest(residual(p, r.impulse, o.law));
    CHECK((e <= o.tolerance) == (r.status == SolveStatus::kConverged));
  }
  return t;
}

}  // namespace

TEST(EveryMethodAndLawReachesTheResidualOnFourFeet) {
  using M = SingleContactMethod;
  for (const int scene : {problems::kStand, problems::kImpact})
    for (const FrictionLaw law : {FrictionLaw::kCoulomb, FrictionLaw::kMaxDissipation})
      for (const M method : {M::kHalley, M::kBisection, M::kQuartic, M::kGoldenSection}) {
        if (method == M::kGoldenSection && law == FrictionLaw::kCoulomb) continue;
        // Golden section compares energies: about 1e-8 of an impulse is all it can resolve.
        const double tolerance = method == M::kGoldenSection ? 1e-5 : 1e-9;
        const Tally t = run(scene, per_contact_options(method, law, tolerance));
        std::printf("  %-16s law %d method %d: sweeps mean %.2f, most %d, unconverged %d\n",
                    problems::scene_name(scene), int(law), int(method), t.sweeps, t.most,
                    t.unconverged);
        CHECK(t.unconverged == 0);
        CHECK(t.sweeps < 8);
      }
}

TEST(ThePapersRelaxationCostsSweepsButConverges) {
  SolveOptions plain =
      per_contact_options(SingleContactMethod::kBisection, FrictionLaw::kCoulomb, 1e-8);
  SolveOptions paper = plain;
  paper.gamma = 0.99;
  const Tally a = run(problems::kImpact, plain), b = run(problems::kImpact, paper);
  std::printf("  sweeps: alpha = 1 %.2f, decaying to 0.7 %.2f\n", a.sweeps, b.sweeps);
  CHECK(a.unconverged == 0 && b.unconverged == 0);
  CHECK(a.sweeps <= b.sweeps);
}

TEST(ThePapersStopTestBoundsTheResidual) {
  SolveOptions o =
      per_contact_options(SingleContactMethod::kBisection, FrictionLaw::kMaxDissipation, 1e-6);
  o.stop = StopTest::kViolationSum, o.gamma = 0.99;
  problems::Random rng(5);
  for (int i = 0; i < 200; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kImpact, rng));
    o.record_history = true;
    const SolveResult r = solve(p, o);
    CHECK(int(r.history.size()) == r.sweeps + 1);  // and the start
    // The sum and the residual measure the same violations; conditioning stays between them.
    CHECK(r.certificate.residual <= 30 * o.tolerance);
  }
}

TEST(TheLawsDifferOnSlidingFeet) {
  problems::Random rng(3);
  int apart = 0;
  for (int i = 0; i < 100; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kImpact, rng));
    SolveOptions o = per_contact_options(SingleContactMethod::kHalley, FrictionLaw::kCoulomb, 1e-9);
    const SolveResult a = solve(p, o);
    o.law = FrictionLaw::kMaxDissipation;
    const SolveResult b = solve(p, o);
    double difference = 0;
    for (std::size_t k = 0; k < a.impulse.size(); ++k)
      difference = std::fmax(difference, std::fabs(a.impulse[k] - b.impulse[k]));
    apart += difference > 0.01 * problems::largest(a.impulse);
  }
  std::printf("  impulses apart by more than 1 %%: %d of 100\n", apart);
  CHECK(apart > 20);
}

TEST(FrictionOpposesSlidingUnderCoulombsLaw) {
  problems::Random rng(8);
  for (int i = 0; i < 100; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kImpact, rng));
    const SolveResult r =
        solve(p, per_contact_options(SingleContactMethod::kHalley, FrictionLaw::kCoulomb, 1e-10));
    for (int k = 0; k < p.num_contacts(); ++k) {
      const double *l = &r.impulse[3 * k], *v = &r.velocity[3 * k];
      const double size = std::hypot(l[0], l[1]), speed = std::hypot(v[0], v[1]);
      CHECK(l[2] >= 0 && v[2] >= -1e-9 && size <= p.friction[k] * l[2] * (1 + 1e-12) + 1e-15);
      CHECK_NEAR(l[2] * v[2], 0, 1e-8);
      if (speed > 1e-4 && l[2] > 1e-6)
        CHECK_NEAR((l[0] * v[0] + l[1] * v[1]) / (size * speed), -1, 1e-6);
    }
  }
}

TEST(RawArraysGiveTheSameAnswerAsTheApi) {
  problems::Random rng(21);
  const ContactProblem p =
      problems::dense(problems::random_robot_problem(problems::kDropEight, rng));
  const int n = p.num_contacts();
  std::vector<double> impulse(3 * n), workspace(contact::ExplicitProblem::workspace_size(n));
  contact::ExplicitProblem e;
  e.n = n, e.G = p.delassus.data(), e.c = p.free_velocity.data(), e.mu = p.friction.data(),
  e.lambda = impulse.data();
  e.attach(workspace.data());
  contact::prepare(e);
  contact::SweepOptions o;
  const contact::SweepResult s = contact::per_contact(e, o);
  const SolveResult r =
      solve(p, per_contact_options(SingleContactMethod::kHalley, FrictionLaw::kCoulomb, 1e-9));
  CHECK(s.sweeps == r.sweeps);
  CHECK(impulse == r.impulse);
}
