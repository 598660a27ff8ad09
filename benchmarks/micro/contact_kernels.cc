// Medians of the contact kernels on one core: the slip solve of one contact, and the factored solve
// of four feet. Each figure is checked: a solve that does not meet its residual makes the program
// fail.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <vector>

#include "scenes/contact_families.h"
#include "tests/cpp/contact/robot_problems.h"

using namespace stickslip;
using namespace stickslip::contact;
using namespace problems;

namespace {

/// CPU seconds of this thread: other programs on the machine do not count.
double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Median over rounds of the nanoseconds per call of `body(k)`, k < n.
template <class F>
double median_ns(int n, F body) {
  std::vector<double> rounds;
  for (int r = 0; r < 11; ++r) {
    const double start = thread_seconds();
    for (int k = 0; k < n; ++k) body(k);
    rounds.push_back((thread_seconds() - start) / n * 1e9);
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds[rounds.size() / 2];
}

bool good = true;

template <bool kMaxDissipation>
void time_slip(ContactFamily family, double tolerance) {
  const std::vector<SingleContact> problems =
      random_contacts(family, 20000, 7, ContactMix::kSlipOnly);
  std::vector<LocalContact<double>> local;
  for (const SingleContact& p : problems) {
    LocalContact<double> k = {};
    k.xx = p.G[0], k.xy = p.G[1], k.xz = p.G[2], k.yy = p.G[4], k.yz = p.G[5], k.zz = p.G[8],
    k.mu = p.mu;
    prepare(k);
    local.push_back(k);
  }
  long evaluations = 0;
  std::vector<double> impulse(3 * local.size());
  const double ns = median_ns(int(local.size()), [&](int i) {
    int n;
    solve_halley<kMaxDissipation>(local[i], problems[i].c.data(), tolerance, &impulse[3 * i], n);
    evaluations += n;
  });
  if (!kMaxDissipation)
    for (size_t i = 0; i < local.size(); ++i) {
      double v[3], speed = 0;
      apply_block(local[i], &impulse[3 * i], v);
      for (int r = 0; r < 3; ++r)
        v[r] += problems[i].c[r], speed += problems[i].c[r] * problems[i].c[r];
      good = good && natural_map_residual(local[i], v, &impulse[3 * i]) <=
                         10 * tolerance * std::sqrt(speed);
    }
  std::printf("  %-16s %-16s tolerance %g: %6.1f ns, %.2f evaluations\n", family_name(family),
              kMaxDissipation ? "max_dissipation" : "coulomb", tolerance, ns,
              double(evaluations) / (11.0 * local.size()));
}

/// Adds J L^-1 x to the free velocities: a change that the contacts can take, also where they are
/// redundant.
void perturb(RobotProblem& p, double size, Random& rng) {
  double x[18];
  for (double& e : x) e = size * rng.normal();
  for (int i = 0; i < p.n; ++i)
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 18; ++k) p.c0[i][r] += p.y[i][r][k] * x[k];
}

/// Sets of eight problems, each solved fifty times in turn (what a step leaves in the caches), cold
/// or from the solution of a problem whose velocities differ by about 1 %.
void time_factored(int scene, bool warm, double mu) {
  constexpr int kSets = 40, kEach = 8, kPasses = 50;
  const FactoredCapacity capacity{12, 12};
  const long bytes = (FactoredProblem<double>::required_bytes(capacity) + 63) / 64 * 64;
  Random rng(100 + scene);
  char* blocks[kEach];
  FactoredProblem<double> problems[kEach];
  for (int i = 0; i < kEach; ++i) {
    blocks[i] = static_cast<char*>(std::aligned_alloc(64, bytes));
    problems[i].attach(blocks[i], capacity);
  }
  std::vector<double> times;
  double start[kEach][12][3] = {};
  long sweeps = 0, steps = 0, above = 0;
  for (int set = 0; set < kSets; ++set) {
    for (int i = 0; i < kEach; ++i) {
      RobotProblem p = random_robot_problem(scene, rng);
      if (mu > 0) p.mu = mu;
      fill(problems[i], p, 0);
      if (!warm) continue;
      solve_factored(problems[i]);
      for (int c = 0; c < p.n; ++c)
        for (int r = 0; r < 3; ++r) start[i][c][r] = problems[i].impulse(c)[r];
      perturb(p, scene == kStand ? 3e-4 : 3e-2, rng);
      fill(problems[i], p, 0);
    }
    const double from = thread_seconds();
    for (int pass = 0; pass < kPasses; ++pass)
      for (int i = 0; i < kEach; ++i) {
        for (int c = 0; c < problems[i].size(); ++c)
          for (int r = 0; r < 3; ++r) problems[i].impulse(c)[r] = start[i][c][r];
        const auto info = solve_factored(problems[i]);
        sweeps += info.sweeps, steps += info.newton_steps, above += !info.converged;
      }
    times.push_back((thread_seconds() - from) / (kPasses * kEach) * 1e9);
  }
  std::sort(times.begin(), times.end());
  const double solves = double(kSets) * kEach * kPasses;
  std::printf(
      "  %-26s %-4s mu %-7s %7.0f ns, sweeps %.2f, Newton steps %.2f, above 1e-8: %.2f %%\n",
      scene_name(scene), warm ? "warm" : "cold",
      mu > 1   ? "sticks"
      : mu > 0 ? "slips"
               : "random",
      times[kSets / 2], double(sweeps) / solves, double(steps) / solves,
      100.0 * double(above) / solves);
  if (scene <= kImpact) good = good && above == 0;
  for (char* b : blocks) std::free(b);
}

}  // namespace

int main() {
  std::puts("slip impulse of one contact, opening and sticking tests included");
  for (double tolerance : {1e-6, 1e-10})
    for (const ContactFamily family : kContactFamilies) {
      time_slip<false>(family, tolerance);
      time_slip<true>(family, tolerance);
    }
  std::puts("factored solve, blocks and certificate included");
  for (bool warm : {true, false}) {
    time_factored(kStand, warm, 10);
    time_factored(kImpact, warm, 0.1);
    for (int scene = 0; scene < kNumScenes; ++scene) time_factored(scene, warm, 0);
  }
  std::puts(good ? "all checked solves meet their residual"
                 : "FAILED: a solve does not meet its residual");
  return good ? 0 : 1;
}
