// The public contact API: bad input, degenerate problems, invariances, truthful status.
#include <stickslip/errors.h>

#include <algorithm>
#include <limits>

#include "check.h"
#include "contact/dense_problems.h"

using namespace stickslip;

namespace {

ContactProblem block() { return {{2, 0.5, 0.3, 0.5, 1, -0.2, 0.3, -0.2, 1.5}, {1, -2, -3}, {0.5}}; }
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool finite(const SolveResult& r) {
  const auto all = [](const std::vector<double>& x) {
    return std::all_of(x.begin(), x.end(), [](double e) { return std::isfinite(e); });
  };
  return all(r.impulse) && all(r.velocity) && all(r.certificate.residuals) &&
         std::isfinite(r.certificate.residual);
}

}  // namespace

TEST(BadProblemsAreNamedWithTheirFirstOffendingEntry) {
  ContactProblem p = block();
  p.delassus.pop_back();
  CHECK_THROWS(p.validate(), ModelError, "delassus has 8 values; 9 expected");
  p = block(), p.free_velocity.push_back(0);
  CHECK_THROWS(p.validate(), ModelError, "free_velocity has 4 values; 3 expected");
  p = block(), p.delassus[5] = kNan;
  CHECK_THROWS(p.validate(), ModelError, "delassus[1, 2] is nan");
  p = block(), p.delassus[1] = 0.6;
  CHECK_THROWS(p.validate(), ModelError, "not symmetric: [1, 0] and [0, 1] differ by 0.1");
  p = block(), p.delassus[4] = -1;
  CHECK_THROWS(p.validate(), ModelError, "delassus[1, 1] is -1");
  p = block(), p.delassus[1] = p.delassus[3] = 5;
  CHECK_THROWS(p.validate(), ModelError, "indefinite");
  p = block(), p.free_velocity[2] = kInfinity;
  CHECK_THROWS(p.validate(), ModelError, "free_velocity[2] is inf");
  p = block(), p.free_velocity[2] = 1e80;
  CHECK_THROWS(p.validate(), ModelError, "free_velocity has a largest entry of 1e+80 m/s");
  p = block();
  for (double& g : p.delassus) g *= 1e-80;
  CHECK_THROWS(p.validate(), ModelError, "it must be 0 or lie in [1e-40, 1e+40]");
  p = block(), p.friction[0] = -0.1;
  CHECK_THROWS(p.validate(), ModelError, "friction[0] is -0.1");
  p = block(), p.friction[0] = kNan;
  CHECK_THROWS(p.validate(), ModelError, "friction[0] is nan");
}

TEST(BadOptionsAndImpulsesAreNamed) {
  const ContactProblem p = block();
  SolveOptions o;
  o.tolerance = 0;
  CHECK_THROWS(solve(p, o), ModelError, "tolerance");
  o = {}, o.relative_tolerance = -1;
  CHECK_THROWS(solve(p, o), ModelError, "relative_tolerance is -1");
  o = {}, o.max_iterations = -1;
  CHECK_THROWS(solve(p, o), ModelError, "max_iterations is -1");
  o = {}, o.proximal_weight = 0;
  CHECK_THROWS(solve(p, o), ModelError, "proximal_weight is 0");
  o = {}, o.law = FrictionLaw::kMaxDissipation, o.minimum_norm = true;
  CHECK_THROWS(solve(p, o), ModelError, "minimum_norm is for law coulomb");
  o = {}, o.max_sweeps = 0;
  CHECK_THROWS(solve(p, o), ModelError, "max_sweeps");
  o = {}, o.alpha = kNan;
  CHECK_THROWS(solve(p, o), ModelError, "alpha");
  o = {}, o.method = SolveMethod::kPgs, o.law = FrictionLaw::kMaxDissipation;
  CHECK_THROWS(solve(p, o), ModelError, "pgs solves law coulomb only");
  o = {}, o.method = SolveMethod::kPerContact,
  o.single_contact = SingleContactMethod::kGoldenSection;
  CHECK_THROWS(solve(p, o), ModelError, "golden_section minimizes the energy");
  CHECK_THROWS(solve(p, {}, {1, 2}), ModelError, "the warm start has 2 values; 3 expected");
  CHECK_THROWS(solve(p, {}, {1, kNan, 2}), ModelError, "the warm start[1] is nan");
  CHECK_THROWS(residual(p, {1}), ModelError, "the impulse has 1 values");
  SingleContactOptions s;
  s.method = SingleContactMethod::kGoldenSection;
  CHECK_THROWS(solve_contact(p.delassus.data(), p.free_velocity.data(), 0.5, s), ModelError,
               "golden_section");
}

TEST(AHistoryIsAsLongAsTheSolveWhateverTheCap) {
  SolveOptions o;
  o.method = SolveMethod::kPerContact, o.record_history = true;
  o.max_sweeps = std::numeric_limits<int>::max();
  const SolveResult r = solve(block(), o);
  CHECK(int(r.history.size()) == r.sweeps + 1 && r.sweeps < 100);  // and the start
  for (std::size_t k = 1; k < r.history.size(); ++k)
    CHECK(r.history[k].time >= r.history[k - 1].time);
  CHECK(r.history.back().residual <= o.tolerance);
}

TEST(AProblemWithoutContactsIsSolved) {
  const SolveResult r = solve({}, {});
  CHECK(r.status == SolveStatus::kConverged && r.impulse.empty() && r.certificate.residual == 0);
}

TEST(AutoSolvesEveryRobotScene) {
  for (int scene = 0; scene < problems::kNumScenes; ++scene) {
    problems::Random rng(31 + scene);
    int unconverged = 0, sweeps = 0;
    for (int i = 0; i < 300; ++i) {
      const SolveResult r = solve(problems::dense(problems::random_robot_problem(scene, rng)));
      unconverged += r.status != SolveStatus::kConverged, sweeps += r.sweeps;
    }
    std::printf("  %-26s unconverged %d of 300, sweeps %.1f\n", problems::scene_name(scene),
                unconverged, sweeps / 300.0);
    CHECK(unconverged == 0);
  }
}

TEST(AutoSolvesMaximumDissipationOnFourFeet) {
  problems::Random rng(32);
  SolveOptions o;
  o.law = FrictionLaw::kMaxDissipation;
  for (int i = 0; i < 200; ++i)
    CHECK(
        solve(problems::dense(problems::random_robot_problem(problems::kImpact, rng)), o).status ==
        SolveStatus::kConverged);
}

TEST(TowersAndTheirMassRatiosAreSolved) {
  for (const double ratio : {1.0, 100.0, 1000.0})
    for (const int copies : {1, 2}) {
      const ContactProblem p =
          problems::duplicate(problems::box_stack({1, ratio, 1}, 0.5, 2), copies);
      const SolveResult r = solve(p);
      std::printf("  1 : %g : 1, %d copies: residual %.1e, sweeps %d, Newton steps %d\n", ratio,
                  copies, r.certificate.residual, r.sweeps, r.newton_steps);
      CHECK(r.status == SolveStatus::kConverged);
      // The ground carries the weight.
      double weight = 0;
      for (int i = 0; i < 4 * copies; ++i) weight += r.impulse[3 * i + 2];
      CHECK_NEAR(weight, (2 + ratio) * 9.81e-3, 1e-8 * ratio);
    }
}

TEST(DuplicatedContactsGiveTheSameVelocities) {
  problems::Random rng(33);
  for (int i = 0; i < 50; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kImpact, rng));
    const SolveResult a = solve(p), b = solve(problems::duplicate(p, 2));
    CHECK(a.status == SolveStatus::kConverged && b.status == SolveStatus::kConverged);
    for (int k = 0; k < p.num_contacts(); ++k)
      for (int r = 0; r < 3; ++r) CHECK_NEAR(a.velocity[3 * k + r], b.velocity[6 * k + r], 1e-6);
  }
}

TEST(FrictionMayBeZeroOrInfinite) {
  for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kPerContact, SolveMethod::kPgs})
    for (const double mu : {0.0, 1e-12, 1e6, 1e300, kInfinity}) {
      ContactProblem p = block();
      p.friction[0] = mu;
      SolveOptions o;
      o.method = method, o.max_sweeps = 100000;
      const SolveResult r = solve(p, o);
      CHECK(finite(r));
      CHECK(r.status == SolveStatus::kConverged);
      if (mu == 0)
        CHECK(r.impulse[0] == 0 && r.impulse[1] == 0 && std::fabs(r.impulse[2] - 2) < 1e-8);
      if (mu > 1) CHECK_NEAR(problems::largest(r.velocity), 0, 1e-8);
    }
}

TEST(AContactThatCannotPushIsReported) {
  ContactProblem p{{2, 0.5, 0, 0.5, 1, 0, 0, 0, 0}, {1, -2, -3}, {0.5}};
  for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kPerContact})
    for (const FrictionLaw law : {FrictionLaw::kCoulomb, FrictionLaw::kMaxDissipation}) {
      SolveOptions o;
      o.method = method, o.law = law, o.max_sweeps = 20;
      const SolveResult r = solve(p, o);
      CHECK(finite(r) && r.status == SolveStatus::kInfeasible && r.certificate.residual > 1);
    }
  p.free_velocity[2] = 3;  // moving away: nothing is asked of it
  CHECK(solve(p).status == SolveStatus::kConverged);
  const ContactProblem none{std::vector<double>(9), {0, 0, -1}, {0.5}};
  CHECK(finite(solve(none)) && solve(none).status == SolveStatus::kInfeasible);
}

TEST(AStatusNeverClaimsMoreThanTheResidual) {
  problems::Random rng(34);
  for (int i = 0; i < 100; ++i) {
    const ContactProblem p =
        problems::dense(problems::random_robot_problem(problems::kDropTwelve, rng));
    for (const SolveMethod method :
         {SolveMethod::kAuto, SolveMethod::kPerContact, SolveMethod::kPgs}) {
      SolveOptions o;
      o.method = method, o.max_sweeps = 3, o.tolerance = 1e-10;
      const SolveResult r = solve(p, o);
      CHECK(finite(r));
      CHECK((r.status == SolveStatus::kConverged) ==
            (problems::largest(residual(p, r.impulse)) <= o.tolerance));
      CHECK(r.certificate.residual <=
            problems::largest(residual(p, std::vector<double>(r.impulse.size()))));
    }
  }
}

TEST(ScalingMassesScalesImpulses) {
  problems::Random rng(35);
  const ContactProblem p = problems::dense(problems::random_robot_problem(problems::kImpact, rng));
  const SolveResult a = solve(p);
  for (const double mass : {1e-6, 1e-3, 1e3, 1e6}) {
    ContactProblem q = p;
    for (double& x : q.delassus) x /= mass;
    const SolveResult b = solve(q);
    CHECK(b.status == SolveStatus::kConverged);
    for (std::size_t k = 0; k < a.impulse.size(); ++k)
      CHECK_NEAR(b.impulse[k] / mass, a.impulse[k], 1e-7);
  }
}

TEST(TheOrderOfContactsDoesNotMatter) {
  problems::Random rng(36);
  const ContactProblem p = problems::dense(problems::random_robot_problem(problems::kImpact, rng));
  const int n = p.num_contacts(), m = 3 * n;
  ContactProblem q = p;
  const auto other = [n](int i) { return 3 * (n - 1 - i / 3) + i % 3; };
  for (int i = 0; i < m; ++i) {
    q.free_velocity[i] = p.free_velocity[other(i)], q.friction[i / 3] = p.friction[other(i) / 3];
    for (int j = 0; j < m; ++j) q.delassus[i * m + j] = p.delassus[other(i) * m + other(j)];
  }
  const SolveResult a = solve(p), b = solve(q);
  for (int i = 0; i < m; ++i) CHECK_NEAR(b.impulse[i], a.impulse[other(i)], 1e-7);
}

TEST(TheDirectionOfTheTangentialAxesDoesNotMatter) {
  problems::Random rng(37);
  const ContactProblem p = problems::dense(problems::random_robot_problem(problems::kImpact, rng));
  const int m = 3 * p.num_contacts();
  // R turns each contact frame about its normal: G' = R G R^T, c' = R c, lambda' = R lambda.
  std::vector<double> R(m * m), half(m * m);
  for (int i = 0; i < m / 3; ++i) {
    const double c = std::cos(i + 1.0), s = std::sin(i + 1.0),
                 block[3][3] = {{c, s, 0}, {-s, c, 0}, {0, 0, 1}};
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 3; ++k) R[(3 * i + r) * m + 3 * i + k] = block[r][k];
  }
  ContactProblem q = p;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < m; ++j)
      for (int k = 0; k < m; ++k) half[i * m + j] += R[i * m + k] * p.delassus[k * m + j];
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < m; ++j) {
      double sum = 0;
      for (int k = 0; k < m; ++k) sum += half[i * m + k] * R[j * m + k];
      q.delassus[i * m + j] = sum;
    }
  for (int i = 0; i < m; ++i)
    for (int j = i; j < m; ++j) q.delassus[j * m + i] = q.delassus[i * m + j];
  const auto turned = [&](const std::vector<double>& x) {
    std::vector<double> y(m);
    for (int i = 0; i < m; ++i)
      for (int k = 0; k < m; ++k) y[i] += R[i * m + k] * x[k];
    return y;
  };
  q.free_velocity = turned(p.free_velocity);
  const std::vector<double> a = turned(solve(p).impulse), b = solve(q).impulse;
  for (int i = 0; i < m; ++i) CHECK_NEAR(b[i], a[i], 1e-7);
}

TEST(AWarmStartAtTheSolutionStaysThere) {
  problems::Random rng(38);
  const ContactProblem p = problems::dense(problems::random_robot_problem(problems::kImpact, rng));
  SolveOptions o;
  o.method = SolveMethod::kPerContact;
  const SolveResult a = solve(p, o), b = solve(p, o, a.impulse);
  CHECK(a.sweeps > 1 && b.sweeps == 0 && b.stage == SolveStage::kStart);
  CHECK(b.status == SolveStatus::kConverged);
  for (std::size_t i = 0; i < a.impulse.size(); ++i) CHECK_NEAR(b.impulse[i], a.impulse[i], 1e-15);
}

TEST(SolveContactAgreesWithSolve) {
  const ContactProblem p = block();
  const SolveResult a = solve(p);
  for (const auto method : {SingleContactMethod::kHalley, SingleContactMethod::kBisection,
                            SingleContactMethod::kQuartic}) {
    SingleContactOptions o;
    o.method = method;
    const SingleContactResult b =
        solve_contact(p.delassus.data(), p.free_velocity.data(), p.friction[0], o);
    CHECK(b.converged && b.evaluations > 0);
    for (int k = 0; k < 3; ++k) CHECK_NEAR(a.impulse[k], b.impulse[k], 1e-8);
  }
}

TEST(AJammedContactIsFiniteAndNotCalledSolved) {
  // A planar arm, G = j j^T, driven at the ground so that friction presses it in: no finite
  // impulse.
  const double j[3] = {-1, 0, 0.5}, mu = 0.8;
  ContactProblem p{std::vector<double>(9), {1, 0, -0.5 - 0.3}, {mu}};
  for (int a = 0; a < 9; ++a) p.delassus[a] = j[a / 3] * j[a % 3];
  for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kPerContact, SolveMethod::kPgs})
    for (const double sign : {1.0, -1.0}) {
      p.free_velocity[2] = -0.5 - 0.3 * sign;
      SolveOptions o;
      o.method = method;
      const SolveResult r = solve(p, o);
      CHECK(finite(r));
      CHECK((r.status == SolveStatus::kConverged) == (r.certificate.residual <= o.tolerance));
      SingleContactOptions single;
      const auto s = solve_contact(p.delassus.data(), p.free_velocity.data(), mu, single);
      CHECK(std::isfinite(s.impulse[0]) && std::isfinite(s.impulse[2]));
      CHECK(s.converged == (r.status == SolveStatus::kConverged) || method != SolveMethod::kAuto);
    }
}

TEST(MatricesRoundedToFewDigitsAreSolvedAsTheyAre) {
  // A tower's singular G with entries rounded to 7 digits, as text files have them: slightly
  // indefinite.
  ContactProblem p = problems::box_stack({1, 2, 1}, 0.5, 1);
  const double unit = 1e-7 * problems::largest(p.delassus);
  for (double& x : p.delassus) x = std::round(x / unit) * unit;
  const SolveResult r = solve(p);
  std::printf("  residual %.1e, sweeps %d, Newton steps %d\n", r.certificate.residual, r.sweeps,
              r.newton_steps);
  CHECK(finite(r) && r.certificate.residual <= 1e-6);
  CHECK((r.status == SolveStatus::kConverged) == (r.certificate.residual <= 1e-9));
}

TEST(AContactOnARailSlidesIfItsNormalVelocityIsPrescribed) {
  // One degree of freedom along t: G = t t^T. The free velocity along t with an allowed approach
  // added to its normal part is not in the range of G, so nothing stops the contact; it slides
  // along t and friction opposes that. (Where mu |w| > 1 the rail may jam: no finite impulse does
  // it.)
  problems::Random rng(40);
  for (int i = 0; i < 300; ++i) {
    double t[2][3], c[3];
    for (auto& row : t)
      for (double& x : row) x = rng.normal();
    const int rank = 1 + i % 2;
    ContactProblem p{std::vector<double>(9), {}, {rng.uniform(0.1, 1)}};
    for (int a = 0; a < 9; ++a)
      for (int k = 0; k < rank; ++k) p.delassus[a] += t[k][a / 3] * t[k][a % 3];
    const double along[2] = {rng.normal(), rng.normal()};
    for (int a = 0; a < 3; ++a) {
      c[a] = a == 2 ? rng.uniform(0, 1) : 0;
      for (int k = 0; k < rank; ++k) c[a] += t[k][a] * along[k];
    }
    p.free_velocity.assign(c, c + 3);
    if (p.friction[0] * std::hypot(p.delassus[2], p.delassus[5]) >= p.delassus[8]) continue;
    for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kPerContact})
      for (const auto single : {SingleContactMethod::kHalley, SingleContactMethod::kBisection}) {
        SolveOptions o;
        o.method = method, o.single_contact = single;
        const SolveResult r = solve(p, o);
        CHECK(finite(r));
        CHECK(r.status == SolveStatus::kConverged);
      }
  }
}
