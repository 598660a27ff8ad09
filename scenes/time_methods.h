// Times the single-contact methods on given contacts (Table I of [Hwangbo 2018]): interleaved
// rounds, medians.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <vector>

#include "contact/residual.h"
#include "contact/single.h"

namespace stickslip::scenes {

/// One method's figures over all contacts.
struct MethodTime {
  double ns_per_solve =
      0;  ///< median over the rounds, opening and sticking tests included, precomputation not
  double evaluations = 0;  ///< mean per sliding contact
  double failures =
      0;  ///< share of contacts that the method says or the certificate shows it did not solve
};

/// Contacts prepared once, as a step does.
struct TimedContacts {
  std::vector<contact::LocalContact<double>> local;
  std::vector<double> c;        // (3n) [m/s]
  std::vector<double> impulse;  // (3n) [N s], of the last round
  std::vector<int> evaluations;
  std::vector<char> converged;
};

/// `G` row-major (n, 3, 3) [1/kg], `c` (n, 3) [m/s], `mu` (n).
inline TimedContacts prepare_contacts(const double* G, const double* c, const double* mu,
                                      std::size_t n) {
  TimedContacts t;
  t.local.resize(n), t.c.assign(c, c + 3 * n), t.impulse.resize(3 * n), t.evaluations.resize(n),
      t.converged.resize(n);
  for (std::size_t i = 0; i < n; ++i, G += 9) {
    auto& k = t.local[i];
    k.xx = G[0], k.xy = G[1], k.xz = G[2], k.yy = G[4], k.yz = G[5], k.zz = G[8], k.mu = mu[i];
    contact::prepare(k);
  }
  return t;
}

/// CPU seconds of this thread: other programs on the machine do not count.
inline double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Seconds of one pass of one method over all contacts.
template <contact::Method method, bool kMaxDissipation>
inline double time_pass(TimedContacts& t, double tolerance) {
  const double start = thread_seconds();
  for (std::size_t i = 0; i < t.local.size(); ++i) {
    // Halley stops at a velocity; a tenth of what the impulse tolerance changes keeps its impulse
    // error below it as well.
    const double stop =
        method == contact::Method::kHalley ? 0.1 * tolerance * t.local[i].scale : tolerance;
    const auto s = contact::solve_single<method, kMaxDissipation>(t.local[i], &t.c[3 * i], stop);
    t.impulse[3 * i] = s.x, t.impulse[3 * i + 1] = s.y, t.impulse[3 * i + 2] = s.z;
    t.evaluations[i] = s.evaluations, t.converged[i] = s.converged;
  }
  return thread_seconds() - start;
}

inline double time_pass(TimedContacts& t, contact::Method method, bool max_dissipation,
                        double tolerance) {
  double seconds = NAN;
  contact::with_method(method, max_dissipation, [&](auto m, auto law) {
    seconds = time_pass<decltype(m)::value, decltype(law)::value>(t, tolerance);
  });
  return seconds;
}

/// Velocity by which one contact misses its law [m/s]. Coulomb: natural map. Maximum dissipation:
/// |G (lambda - exact)|.
inline double miss(const contact::LocalContact<double>& k, const double c[3],
                   const double lambda[3], bool max_dissipation) {
  double v[3];
  if (max_dissipation) {
    const auto s = contact::solve_single<contact::Method::kHalley, true>(k, c, 0);
    const double d[3] = {lambda[0] - s.x, lambda[1] - s.y, lambda[2] - s.z};
    contact::apply_block(k, d, v);
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  }
  contact::apply_block(k, lambda, v);
  for (int i = 0; i < 3; ++i) v[i] += c[i];
  return contact::natural_map_residual(k, v, lambda);
}

/// Figures of the last pass; a contact fails if the method says so or if it misses its law by more
/// than ten times what the tolerance allows, `tolerance` [N s] times the block's size.
inline MethodTime figures(const TimedContacts& t, double seconds, bool max_dissipation,
                          double tolerance) {
  MethodTime m;
  m.ns_per_solve = 1e9 * seconds / t.local.size();
  std::size_t slips = 0, failed = 0;
  for (std::size_t i = 0; i < t.local.size(); ++i) {
    slips += t.evaluations[i] > 0, m.evaluations += t.evaluations[i];
    const double allowed = 10 * tolerance * std::max(3 * t.local[i].scale, 1.0);
    failed += !t.converged[i] ||
              !(miss(t.local[i], &t.c[3 * i], &t.impulse[3 * i], max_dissipation) <= allowed);
  }
  m.evaluations /= std::max<std::size_t>(slips, 1);
  m.failures = double(failed) / t.local.size();
  return m;
}

/// All methods on the same contacts, one pass each per round, so that a slow moment of the machine
/// hits all of them.
inline std::vector<MethodTime> time_methods(TimedContacts& t,
                                            const std::vector<contact::Method>& methods,
                                            bool max_dissipation, double tolerance,
                                            int rounds = 7) {
  std::vector<std::vector<double>> seconds(methods.size());
  std::vector<MethodTime> out;
  for (int round = 0; round < rounds; ++round)
    for (std::size_t m = 0; m < methods.size(); ++m)
      seconds[m].push_back(time_pass(t, methods[m], max_dissipation, tolerance));
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::sort(seconds[m].begin(), seconds[m].end());
    time_pass(t, methods[m], max_dissipation, tolerance);
    out.push_back(figures(t, seconds[m][seconds[m].size() / 2], max_dissipation, tolerance));
  }
  return out;
}

}  // namespace stickslip::scenes
