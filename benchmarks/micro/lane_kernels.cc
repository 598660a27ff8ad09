// The factored solve with one robot per lane: nanoseconds per robot, and how many sweeps and Newton
// steps a pack takes. Lanes are in different phases of their task, so slots are the union of what
// they need (docs/theory/solvers.md; the plain solve: contact_kernels.cc). Solves are warm started
// from the solution of a problem a little different; every solve is checked.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <vector>

#include "contact/factored.h"
#include "scenes/quadruped.h"

using namespace stickslip;
using namespace stickslip::contact;
using namespace stickslip::scenes;

namespace {

double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

constexpr int kSlots = 12;

/// A task: which of the twelve slots (feet, then torso corners) a robot uses, and how it moves.
struct Task {
  const char* name;
  QuadrupedScene scene;
  double change;  // of the joint velocities between the warm start and the problem
  unsigned (*slots)(Random&);
};
unsigned feet(Random&) { return 0xf; }
unsigned diagonal(Random& rng) { return rng.below(2) ? 0x9 : 0x6; }
unsigned landing(Random& rng) {
  // Of the torso an end, a side, all of it, or nothing.
  unsigned s = 0;
  for (int k = 0; k < 4; ++k) s |= unsigned(rng.below(4) > 0) << k;
  const int side = rng.below(4);
  s |= side == 0 ? 0xff0u : side == 1 ? 0xf0u : side == 2 ? 0x330u : 0x0u;
  return s ? s : 1;
}
unsigned sparse(Random& rng) {
  unsigned s = 0;
  for (int k = rng.integer(0, 3); k > 0; --k) s |= 1u << rng.below(8);
  return s;
}
unsigned two_soles(Random& rng) {
  // One sole of four points, or both.
  const int which = rng.below(3);
  return which == 0 ? 0xfu : which == 1 ? 0xf0u : 0xffu;
}
constexpr Task kTasks[] = {
    {"STAND", kStand, 3e-4, feet},         {"TROT", kTrot, 3e-3, diagonal},
    {"HANG", kImpact, 3e-3, feet},         {"DROP", kDropTwelve, 3e-3, landing},
    {"RANDOM", kDropTwelve, 1e-2, sparse}, {"SOLES", kSoles, 1e-2, two_soles}};

/// One robot: twelve contacts, of which some are active.
struct Robot {
  RobotProblem p;
  unsigned active;
};
Robot random_robot(const Task& t, Random& rng) {
  Robot r;
  // Most of the time what was dropped lies on four feet and four corners.
  const bool lies = t.slots == landing && rng.below(4);
  r.p = random_robot_problem(lies ? kRestEight : t.scene == kTrot ? kImpact : t.scene, rng);
  r.active = t.slots(rng);
  if (lies) r.active = (r.active & 0xff) | 1;
  return r;
}

template <class S>
struct Block {
  explicit Block(FactoredCapacity capacity = {kSlots, 12}) {
    const long bytes = (FactoredProblem<S>::required_bytes(capacity) + 63) / 64 * 64;
    memory.reset(static_cast<char*>(std::aligned_alloc(64, bytes)));
    std::memset(memory.get(), 0, bytes);
    p.attach(memory.get(), capacity);
  }
  struct Free {
    void operator()(char* m) const { std::free(m); }
  };
  std::unique_ptr<char, Free> memory;
  FactoredProblem<S> p;
  S start[kSlots][3];
};

/// The robots of the lanes; slots that no lane uses are left out. The change of each robot's
/// velocities is added `amount` times.
template <class S>
void fill(Block<S>& b, const std::vector<Robot>& robots, const std::vector<double>& change,
          double amount) {
  using T = Value<S>;
  // Soles share the joints of their leg, which are then the dofs 6 to 11.
  const bool soles = robots[0].p.soles;
  const int columns = soles ? 9 : 6;
  b.p.clear(soles ? 12 : 6);
  unsigned all = 0;
  for (const Robot& r : robots) all |= r.active;
  for (int slot = 0; slot < kSlots; ++slot) {
    if (!(all >> slot & 1)) continue;
    const int c = b.p.add();
    S active = constant<S>(0), rows[9][3];
    for (int l = 0; l < int(robots.size()); ++l) {
      const RobotProblem& p = robots[l].p;
      const auto put = [l](S& to, double x) { set_lane(to, l, T(x)); };
      const int i = slot < p.n ? slot : 0;
      put(active, robots[l].active >> slot & 1);
      for (int r = 0; r < 3; ++r) {
        for (int k = 0; k < columns; ++k) put(rows[k][r], p.y[i][r][k < 6 ? k : k + 3 * p.leg[i]]);
        double free = p.c0[i][r];
        for (int k = 0; k < 18; ++k) free += p.y[i][r][k] * amount * change[18 * l + k];
        put(b.p.offset(c)[r], free);
      }
      int e = 0;
      for (int r = 0; r < 3; ++r)
        for (int s = r; s < 3; ++s, ++e) {
          double sum = 0;
          for (int k = 6; k < 18 && !soles; ++k) sum += p.y[i][r][k] * p.y[i][s][k];
          put(b.p.private_block(c)[e], sum);
        }
      put(b.p.friction(c), p.mu);
    }
    b.p.active(c) = active > constant<S>(0);
    for (int k = 0; k < columns; ++k) b.p.y(c)[k] = make_row3(rows[k][0], rows[k][1], rows[k][2]);
    if (!soles) continue;
    const int first = slot < 4 ? 6 : 9;
    const int index[9] = {0, 1, 2, 3, 4, 5, first, first + 1, first + 2};
    b.p.set_index(c, index, 9);
  }
}

bool good = true;

template <class S>
void time_task(const Task& task, const char* name) {
  constexpr int kLanes = ScalarTraits<S>::kWidth, kEach = kLanes > 1 ? 4 : 16;
  constexpr int kSets = 24, kPasses = 2000 / kEach;
  Random rng(100 + (&task - kTasks));
  std::vector<std::unique_ptr<Block<S>>> blocks;
  for (int k = 0; k < kEach; ++k) blocks.push_back(std::make_unique<Block<S>>());
  std::vector<double> times, prepare_times;
  long sweeps = 0, steps = 0, fallbacks = 0, above = 0, slots = 0, contacts = 0;
  for (int set = 0; set < kSets; ++set) {
    for (auto& b : blocks) {
      std::vector<Robot> robots;
      std::vector<double> change;
      for (int l = 0; l < kLanes; ++l) {
        robots.push_back(random_robot(task, rng));
        contacts += __builtin_popcount(robots.back().active);
        for (int k = 0; k < 18; ++k) change.push_back(task.change * rng.normal());
      }
      fill(*b, robots, change, 0);
      solve_factored(b->p);
      for (int c = 0; c < b->p.size(); ++c)
        for (int r = 0; r < 3; ++r) b->start[c][r] = b->p.impulse(c)[r];
      fill(*b, robots, change, 1);
      slots += b->p.size();
    }
    const double from = thread_seconds();
    for (int pass = 0; pass < kPasses; ++pass)
      for (auto& b : blocks) {
        for (int c = 0; c < b->p.size(); ++c)
          for (int r = 0; r < 3; ++r) b->p.impulse(c)[r] = b->start[c][r];
        const FactoredInfo<S> info = solve_factored(b->p);
        sweeps += info.sweeps, steps += info.newton_steps, fallbacks += info.fallbacks;
        above += !all(info.converged);
      }
    times.push_back((thread_seconds() - from) / (kPasses * kEach * kLanes) * 1e9);
    const double then = thread_seconds();
    for (int pass = 0; pass < kPasses; ++pass)
      for (auto& b : blocks)
        for (int c = 0; c < b->p.size(); ++c) {
          for (int r = 0; r < 3; ++r) b->p.impulse(c)[r] = b->start[c][r];
          b->p.six() ? prepare_contact<6>(b->p.contact(c)) : prepare_contact<0>(b->p.contact(c));
        }
    prepare_times.push_back((thread_seconds() - then) / (kPasses * kEach * kLanes) * 1e9);
  }
  std::sort(times.begin(), times.end());
  std::sort(prepare_times.begin(), prepare_times.end());
  const double solves = double(kSets) * kEach * kPasses, packs = double(kSets) * kEach;
  std::printf(
      "  %-7s %-10s %7.1f ns per robot (%.1f before the sweeps), contacts %.1f, slots %.1f, sweeps "
      "%.2f, Newton steps %.2f, fallbacks %.2f %%, unsolved %.2f %%\n",
      task.name, name, times[kSets / 2], prepare_times[kSets / 2], contacts / (packs * kLanes),
      slots / packs, sweeps / solves, steps / solves, 100 * fallbacks / (solves * kLanes),
      100 * above / solves);
  good = good && above <= 0.01 * solves;
}

}  // namespace

int main(int argc, char** argv) {
#ifdef __AVX512F__
  if (!__builtin_cpu_supports("avx512vl")) return std::puts("no AVX-512 here"), 0;
  using Doubles = Pack<double, 8>;
  using Floats = Pack<float, 16>;
  const char *doubles = "double x8", *floats = "float x16";
#elif defined(__ARM_NEON)
  using Doubles = Pack<double, 2>;
  using Floats = Pack<float, 4>;
  const char *doubles = "double x2", *floats = "float x4";
#else
  using Doubles = Pack<double, 4>;
  using Floats = Pack<float, 8>;
  const char *doubles = "double x4", *floats = "float x8";
#endif
  for (const Task& t : kTasks) {
    if (argc > 1 && std::strcmp(argv[1], t.name)) continue;
    if (argc <= 2 || argv[2][0] == 'd') time_task<double>(t, "double");
    if (argc <= 2 || argv[2][0] == 'D') time_task<Doubles>(t, doubles);
    if (argc <= 2 || argv[2][0] == 'F') time_task<Floats>(t, floats);
  }
  if (!good) std::puts("FAILED: a solve does not meet its residual");
  return good ? 0 : 1;
}
