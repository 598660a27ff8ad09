// Nanoseconds per robot of each dynamics pass, on one core: one robot in double (branches as lanes)
// and packs of robots. Every lane is compared with the scalar, bit for bit; a difference makes the
// program fail. The checksum tells whether two builds compute the same.
//
// Columns: passes alone; "all", those of a semi-implicit step one after the other, again and again
// (their data leave the first-level cache in between); "semi", the same in one walk; "safe", what
// an energy-safe step computes.
//
// Usage: bench_dynamics_kernels [anymal.urdf]
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <random>
#include <string>
#include <vector>

#include "dynamics/dynamics.h"
#include "dynamics/random_robots.h"
#include "layout/tree_memory.h"

using namespace stickslip;
using namespace stickslip::dynamics;

namespace {

constexpr int kRounds = 31;

/// CPU seconds of this thread: other programs on the machine do not count.
double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Median over rounds of the nanoseconds per call.
template <class F>
double median_ns(int calls, F body) {
  std::vector<double> rounds;
  for (int r = 0; r < kRounds; ++r) {
    const double start = thread_seconds();
    for (int k = 0; k < calls; ++k) {
      body();
      asm volatile("" ::: "memory");
    }
    rounds.push_back((thread_seconds() - start) / calls * 1e9);
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds[rounds.size() / 2];
}

/// A random state of environment `lane`: quaternion (4), angular velocity (3), linear (3), then per
/// joint position, rate, force.
std::vector<double> random_state(int joints, int lane) {
  std::mt19937 rng(100 + lane);
  std::normal_distribution<double> n;
  std::vector<double> s(10 + 3 * joints);
  for (double& x : s) x = n(rng);
  const double norm = std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3]);
  for (int k = 0; k < 4; ++k) s[k] /= norm;
  return s;
}

/// One robot, or a pack of them, with a state per lane.
template <class S>
struct Robots {
  layout::TreeMemory<S> memory;
  Tree<S>& t;
  std::vector<S> q, rates, tau, diagonal, out;
  S quaternion[4], base[6];
  Vec3<S> w, v, gravity;

  /// `first`: the state of lane 0; the others follow.
  Robots(const Model& model, int first) : memory(model), t(memory.tree()) {
    const int n = model.num_joints();
    for (auto* x : {&q, &rates, &tau, &diagonal, &out}) x->resize(n);
    for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane) {
      const auto s = random_state(n, first + lane);
      const auto put = [&](S& to, double x) { set_lane(to, lane, static_cast<Value<S>>(x)); };
      for (int k = 0; k < 4; ++k) put(quaternion[k], s[k]);
      put(w.x, s[4]), put(w.y, s[5]), put(w.z, s[6]), put(v.x, s[7]), put(v.y, s[8]),
          put(v.z, s[9]);
      for (int j = 0; j < n; ++j) {
        put(q[j], s[10 + j]), put(rates[j], s[10 + n + j]), put(tau[j], s[10 + 2 * n + j]);
        put(diagonal[j], 0.01);
      }
    }
    gravity = {constant<S>(0), constant<S>(0), constant<S>(-9.81)};
  }

  void positions() { compute_positions(t, quaternion, q.data()); }
  void inertias() { compute_inertias(t); }
  void velocities() { compute_velocities(t, w, rates.data()); }
  void bias() { compute_bias(t, w, rates.data(), gravity); }
  void factor() { factor_mass_matrix(t, diagonal.data()); }
  void forces() { solve_lower_transposed(t, tau.data()); }
  void multiply() { multiply_lower(t, v, rates.data()); }
  void solve() { solve_lower(t, base, out.data()); }
  void separate() { positions(), inertias(), bias(), factor(), forces(), solve(); }
  /// The same in one walk, as a semi-implicit step does it.
  void semi_implicit() {
    WalkInput<S> in;
    in.quaternion = quaternion, in.joints = q.data();
    in.angular_velocity = w, in.rates = rates.data(), in.gravity = gravity;
    in.diagonal = diagonal.data(), in.tau = tau.data();
    compute_free_motion(t, in), solve();
  }
  /// What an energy-safe step does when nothing turns fast and nothing touches.
  void energy_safe() {
    multiply_lower(t, w, v, rates.data());
    solve_bias(t, w, rates.data(), gravity), solve();
    positions();
    factor_and_solve_bias(t, diagonal.data(), w, rates.data(), gravity), solve();
    multiply_lower(t, w, v, rates.data());
  }

  /// What steps hand on, after each of the two.
  std::vector<S> results() {
    std::vector<S> r;
    semi_implicit();
    r.insert(r.end(), base, base + 6), r.insert(r.end(), out.begin(), out.end());
    energy_safe();
    r.insert(r.end(), base, base + 6), r.insert(r.end(), out.begin(), out.end());
    r.push_back(squared_norm(t));
    return r;
  }
};

bool good = true;
std::uint64_t checksum = 14695981039346656037ull;

/// The lanes of a pack against the scalar.
template <class S>
void compare(const Model& model) {
  Robots<S> packed(model, 0);
  const auto lanes = packed.results();
  for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane) {
    Robots<Value<S>> one(model, lane);
    const auto scalar = one.results();
    for (size_t k = 0; k < scalar.size(); ++k) {
      const Value<S> x = get_lane(lanes[k], lane);
      good = good && std::memcmp(&x, &scalar[k], sizeof x) == 0;
      for (size_t i = 0; i < sizeof x; ++i)
        checksum = (checksum ^ reinterpret_cast<const unsigned char*>(&x)[i]) * 1099511628211ull;
    }
  }
}

template <class S>
void time_scalar(const char* name, const Model& model) {
  compare<S>(model);
  Robots<S> r(model, 0);
  r.semi_implicit();
  const int calls = 40000 / model.num_joints() / ScalarTraits<S>::kWidth + 100;
  std::printf("  %-10s", name);
  const auto time = [&](auto pass) {
    for (int k = 0; k < 100; ++k) pass();
    std::printf(" %8.1f", median_ns(calls, pass) / ScalarTraits<S>::kWidth);
  };
  time([&] { r.positions(); });
  time([&] { r.inertias(); });
  time([&] { r.velocities(); });
  time([&] { r.bias(); });
  time([&] { r.factor(); });
  time([&] { r.forces(); });
  time([&] { r.multiply(); });
  time([&] { r.solve(); });
  time([&] { r.separate(); });
  time([&] { r.semi_implicit(); });
  time([&] { r.energy_safe(); });
  std::printf("\n");
}

void time_robot(const char* name, const Model& model) {
  std::printf("%s, %d joints: nanoseconds per robot\n  %-10s", name, model.num_joints(), "scalar");
  for (const char* pass : {"position", "inertia", "velocity", "bias", "factor", "L^-T f", "L u",
                           "L^-1 x", "all", "semi", "safe"})
    std::printf(" %8s", pass);
  std::printf("\n");
  time_scalar<double>("double", model);
#if defined(__AVX512F__)
  time_scalar<Pack<double, 8>>("double x8", model);
  time_scalar<Pack<float, 16>>("float x16", model);
#elif defined(__AVX2__)
  time_scalar<Pack<double, 4>>("double x4", model);
#endif
#if defined(__AVX2__)
  time_scalar<Pack<float, 8>>("float x8", model);
#else
  time_scalar<Pack<double, 2>>("double x2", model);
  time_scalar<Pack<float, 4>>("float x4", model);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  const std::string urdf = argc > 1 ? argv[1] : "assets/anymal_b/anymal_b.urdf";
  time_robot("anymal_b", *load_urdf(urdf));
  time_robot("chain", *testing::random_robot(1, 24, 1, BaseType::kFloating));
  time_robot("humanoid", *testing::random_humanoid(2));
  std::printf("checksum %016llx, lanes %s the scalar\n", static_cast<unsigned long long>(checksum),
              good ? "equal" : "DIFFER from");
  return good ? 0 : 1;
}
