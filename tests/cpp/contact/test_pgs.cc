// Projected Gauss-Seidel: the same solutions as per-contact iteration, in many more sweeps.
#include "check.h"
#include "contact/dense_problems.h"

using namespace stickslip;

namespace {
SolveOptions pgs_options(double tolerance, int max_sweeps = 100000) {
  SolveOptions o;
  o.method = SolveMethod::kPgs, o.alpha = 0.6, o.tolerance = tolerance, o.max_sweeps = max_sweeps;
  return o;
}
}  // namespace

TEST(PgsFindsTheVelocitiesThatPerContactIterationFinds) {
  problems::Random rng(2);
  double pgs_sweeps = 0, per_contact_sweeps = 0;
  for (int i = 0; i < 100; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kImpact, rng));
    const SolveResult a = solve(p, pgs_options(1e-9));
    SolveOptions o;
    o.method = SolveMethod::kPerContact;
    const SolveResult b = solve(p, o);
    CHECK(a.status == SolveStatus::kConverged && b.status == SolveStatus::kConverged);
    for (std::size_t k = 0; k < a.velocity.size(); ++k)
      CHECK_NEAR(a.velocity[k], b.velocity[k], 1e-6);
    pgs_sweeps += a.sweeps / 100.0, per_contact_sweeps += b.sweeps / 100.0;
  }
  std::printf("  sweeps at impact: PGS %.1f, per contact %.1f\n", pgs_sweeps, per_contact_sweeps);
  CHECK(pgs_sweeps > 5 * per_contact_sweeps);
}

TEST(ThePapersPgsStopIsMetAndIsWeakerThanTheResidual) {
  problems::Random rng(4);
  SolveOptions o = pgs_options(1e-6);
  o.stop = StopTest::kUpdateSum;
  double worst = 0;
  for (int i = 0; i < 100; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kImpact, rng));
    const SolveResult r = solve(p, o);
    CHECK((r.status == SolveStatus::kConverged) == (r.certificate.residual <= 1e-6));
    worst = std::fmax(worst, r.certificate.residual);
  }
  std::printf("  largest residual where PGS stops at 1e-6 by its own test: %.1e m/s\n", worst);
  CHECK(worst > 1e-6);
}

TEST(PgsSolvesADiagonalProblemInOneSweepWithoutRelaxation) {
  ContactProblem p{{2, 0, 0, 0, 2, 0, 0, 0, 4}, {3, 4, -1}, {0.5}};
  SolveOptions o = pgs_options(1e-12);
  o.alpha = 1;
  const SolveResult r = solve(p, o);
  CHECK(r.sweeps == 1 && r.status == SolveStatus::kConverged);
  CHECK_NEAR(r.impulse[2], 0.25, 1e-15);
  CHECK_NEAR(r.impulse[0], -0.125 * 0.6, 1e-15);
}

TEST(PgsLeavesContactsThatCannotPushAlone) {
  ContactProblem p{{2, 0, 0, 0, 2, 0, 0, 0, 0}, {3, 4, -1}, {0.5}};
  const SolveResult r = solve(p, pgs_options(1e-9, 10));
  CHECK(r.status == SolveStatus::kInfeasible);
  CHECK(r.impulse[2] == 0);
}
