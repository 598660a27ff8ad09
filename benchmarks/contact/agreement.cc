#include "benchmarks/contact/agreement.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <stdexcept>

#include "benchmarks/contact/measure.h"
#include "scenes/random.h"

namespace stickslip::benchmarks {
namespace {

constexpr int kProblems = 100, kContacts = 3;
constexpr double kAgreement = 1e-6, kNotFinite = 1e300;

/// Coupled contacts with G between 1 and about 3 [1/kg]; small friction and coupling make the
/// solution unique. Scales of 0.1 to 10 in mass and velocity show a missing time step or unit.
ContactProblem well_conditioned(scenes::Random& rng) {
  constexpr int m = 3 * kContacts;
  double a[m][m];
  for (auto& row : a)
    for (double& x : row) x = 0.15 * rng.normal();
  const double mass = std::pow(10, rng.uniform(-1, 1)), speed = std::pow(10, rng.uniform(-1, 1));
  ContactProblem p;
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < m; ++j) {
      double g = i == j;
      for (int k = 0; k < m; ++k) g += a[i][k] * a[j][k];
      p.delassus.push_back(g / mass);
    }
    p.free_velocity.push_back(speed * (rng.normal() - (i % 3 == 2 ? 1 : 0)));
  }
  for (int i = 0; i < kContacts; ++i) p.friction.push_back(rng.uniform(0.1, 0.9));
  return p;
}

/// Share of open, sliding and sticking contacts; a solver that knows only one kind must not pass.
void check_mix(const std::vector<ContactProblem>& problems,
               const std::vector<std::vector<double>>& impulses) {
  int kinds[3] = {};
  for (std::size_t p = 0; p < problems.size(); ++p)
    for (int i = 0; i < kContacts; ++i) {
      const double* l = &impulses[p][3 * i];
      const double cone = problems[p].friction[i] * l[2];
      ++kinds[l[2] <= 0 ? 0 : std::hypot(l[0], l[1]) > cone * (1 - 1e-9) ? 1 : 2];
    }
  if (*std::min_element(kinds, kinds + 3) < kProblems * kContacts / 20)
    throw std::logic_error("agreement: too few open, sliding or sticking contacts");
}

}  // namespace

bool solvers_agree(const Methods& methods) {
  scenes::Random rng(1);
  std::vector<ContactProblem> problems;
  std::vector<std::vector<double>> truth;
  for (int k = 0; k < kProblems; ++k) {
    problems.push_back(well_conditioned(rng));
    SolveOptions options;
    options.tolerance = 0, options.relative_tolerance = 1e-12;
    truth.push_back(stickslip::solve(problems.back(), options).impulse);
  }
  check_mix(problems, truth);

  std::map<std::string, double> best;  // per solver: over its settings, the smallest of the worst
  for (const auto& method : methods) {
    if (method->solver().rfind("stickslip", 0) == 0) continue;
    double worst = 0;
    for (int k = 0; k < kProblems; ++k) {
      method->prepare(problems[k]);
      method->solve();
      const std::vector<double> impulse = method->impulse();
      // What would stop the largest free velocity: also where all contacts open, not zero.
      const double unit = velocity_scale(problems[k]) / problems[k].delassus[0];
      for (std::size_t i = 0; i < impulse.size(); ++i) {
        const double difference = std::fabs(impulse[i] - truth[k][i]) / unit;
        worst = std::isfinite(difference) ? std::max(worst, difference) : kNotFinite;
      }
    }
    const auto [entry, fresh] = best.emplace(method->solver(), worst);
    if (!fresh) entry->second = std::min(entry->second, worst);
  }
  bool agree = true;
  for (const auto& [solver, worst] : best) {
    std::printf("agreement  %-24s largest difference %.1e%s\n", solver.c_str(), worst,
                worst <= kAgreement ? "" : "  FAILED: it solves another problem than ours");
    agree = agree && worst <= kAgreement;
  }
  return agree;
}

}  // namespace stickslip::benchmarks
