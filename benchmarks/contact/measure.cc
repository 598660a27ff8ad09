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

/// Seconds of one solve. The clock of the thread costs half a microsecond, so it counts only where
/// the wall clock has run further: there, another process had the core meanwhile.
double timed_solve(Method& method) {
  const double thread = thread_seconds();
  const auto start = std::chrono::steady_clock::now();
  method.solve();
  const auto end = std::chrono::steady_clock::now();
  return std::min(std::chrono::duration<double>(end - start).count(), thread_seconds() - thread);
}

double median(std::vector<double> x) {
  const auto middle = x.begin() + static_cast<long>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

}  // namespace

double velocity_scale(const ContactProblem& problem) {
  double scale = 0;
  for (const double c : problem.free_velocity) scale = std::max(scale, std::fabs(c));
  return scale;
}

double worst_residual(const ContactProblem& problem, const std::vector<double>& impulse) {
  for (const double x : impulse)
    if (!std::isfinite(x)) return std::numeric_limits<double>::infinity();
  const std::vector<double> each = residual(problem, impulse);
  return *std::max_element(each.begin(), each.end());
}

std::vector<Measurement> measure(const ProblemSet& set, const Methods& methods,
                                 const MeasureSettings& settings) {
  const std::size_t count = set.problems.size(), turn = static_cast<std::size_t>(settings.turn);
  std::vector<Measurement> out(methods.size());
  std::vector<std::vector<std::vector<double>>> seconds(methods.size());
  std::vector<double> spent(methods.size(), 0);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    seconds[m].resize(count);
    out[m].residual.resize(count);
  }
  for (int round = 0; round <= settings.rounds; ++round)
    for (std::size_t begin = 0; begin < count; begin += turn)
      for (std::size_t m = 0; m < methods.size(); ++m) {
        if (round > 0 && spent[m] > settings.patience) continue;
        for (std::size_t k = begin; k < std::min(begin + turn, count); ++k) {
          const double scale = velocity_scale(set.problems[k]);
          methods[m]->prepare(set.problems[k], scale);
          const double time = timed_solve(*methods[m]);
          if (round > 0) {
            seconds[m][k].push_back(time);
            continue;
          }
          spent[m] += time;
          out[m].residual[k] = worst_residual(set.problems[k], methods[m]->impulse()) / scale;
          seconds[m][k] = {time};
        }
      }
  for (std::size_t m = 0; m < methods.size(); ++m) {
    for (std::vector<double>& each : seconds[m]) {
      if (each.size() > 1) each.erase(each.begin());  // the warm-up
      out[m].microseconds.push_back(1e6 * median(each));
    }
    out[m].rounds = static_cast<int>(seconds[m][0].size());
  }
  return out;
}

}  // namespace stickslip::benchmarks
