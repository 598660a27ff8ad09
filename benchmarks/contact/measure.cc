#include "benchmarks/contact/measure.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>

namespace stickslip::benchmarks {
namespace {

double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Seconds of one solve. A long one may lose the core to another process meanwhile; the clock of
/// the thread shows it, but costs half a microsecond, and what it disturbs more.
double timed_solve(Method& method, bool is_long) {
  const double thread = is_long ? thread_seconds() : 0;
  const double start = wall_seconds();
  method.solve();
  const double wall = wall_seconds() - start;
  return is_long ? std::min(wall, thread_seconds() - thread) : wall;
}

double median(std::vector<double> x) {
  const auto middle = x.begin() + static_cast<long>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

constexpr double kWarmUp = 2e-4, kLong = 5e-5;  // [s]

/// What one method has been through.
struct Runner {
  Method* method;
  std::vector<std::vector<double>> seconds;  // per problem, per counted round
  std::vector<double> first, residual;       // per problem, of the round before those
  double spent = 0;                          // [s]
  double last = 0;                           // [s]

  Runner(Method& m, std::size_t count)
      : method(&m), seconds(count), first(count), residual(count) {}

  double solve(const ContactProblem& problem) {
    method->prepare(problem);
    last = timed_solve(*method, last > kLong);
    spent += last;
    return last;
  }

  /// Problems begin, ..., end - 1. Whoever solved before has filled the caches with its own code,
  /// so the first solves do not count.
  void take_turn(const ProblemSet& set, int round, std::size_t begin, std::size_t end) {
    double warm = 0;
    for (std::size_t k = begin; k < end && warm < kWarmUp; ++k) warm += solve(set.problems[k]);
    for (std::size_t k = begin; k < end; ++k) {
      const ContactProblem& problem = set.problems[k];
      const double time = solve(problem);
      if (round > 0) {
        seconds[k].push_back(time);
      } else {
        first[k] = time;
        residual[k] = worst_residual(problem, method->impulse()) / velocity_scale(problem);
      }
    }
  }
};

}  // namespace

double velocity_scale(const ContactProblem& problem) {
  double scale = 0;
  for (const double c : problem.free_velocity) scale = std::max(scale, std::fabs(c));
  return scale;
}

double worst_residual(const ContactProblem& problem, const std::vector<double>& impulse) {
  for (const double x : impulse)
    if (!std::isfinite(x)) return std::numeric_limits<double>::infinity();
  double worst = 0;
  for (const double e : residual(problem, impulse))
    worst = std::isfinite(e) ? std::max(worst, e) : std::numeric_limits<double>::infinity();
  return worst;
}

std::vector<Measurement> measure(const ProblemSet& set, const Methods& methods,
                                 const MeasureSettings& settings) {
  const std::size_t count = set.problems.size(), turn = static_cast<std::size_t>(settings.turn);
  std::vector<Runner> runners;
  for (const auto& method : methods) runners.emplace_back(*method, count);
  for (int round = 0; round <= settings.rounds; ++round) {
    std::vector<Runner*> taking_part;  // whole rounds, so that each problem counts as often
    for (Runner& r : runners)
      if (round == 0 || r.spent < settings.patience) taking_part.push_back(&r);
    for (std::size_t begin = 0; begin < count; begin += turn)
      for (Runner* r : taking_part) r->take_turn(set, round, begin, std::min(begin + turn, count));
  }
  std::vector<Measurement> out;
  for (const Runner& r : runners) {
    Measurement m;
    m.residual = r.residual;
    m.rounds = std::max(1, static_cast<int>(r.seconds[0].size()));
    for (std::size_t k = 0; k < count; ++k)
      m.microseconds.push_back(1e6 * (r.seconds[k].empty() ? r.first[k] : median(r.seconds[k])));
    out.push_back(std::move(m));
  }
  return out;
}

}  // namespace stickslip::benchmarks
