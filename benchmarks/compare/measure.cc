#include "benchmarks/compare/measure.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <functional>

#include "benchmarks/compare/agreement.h"
#include "benchmarks/compare/mujoco_loop.h"
#include "benchmarks/compare/stickslip_loop.h"

namespace stickslip::benchmarks {
namespace {

constexpr double kAgreement = 1e-9;    // of the models
constexpr double kBadResidual = 1e-4;  // share of steps above 1e-8 m/s that is let pass

/// Time this thread had a core [s]: others on a busy machine do not count, waiting does not exist.
double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// One engine with what it has been through; the engine's type is hidden behind two functions.
struct Runner {
  std::string name;
  std::function<int(int episode)> time;              // one repetition; returns the next episode
  std::function<int(int episode, Observer&)> watch;  // the same, observed
  std::function<std::uint64_t(std::uint64_t)> hash;  // of the state, mixed into a given hash
  std::vector<int> first_episode;                    // of each repetition
  std::uint64_t state_hash = 0;                      // over the ends of all counted repetitions
  std::vector<double> microseconds;
};

template <class Engine>
Runner make_runner(std::string name, std::shared_ptr<Engine> engine, const Scenario& s,
                   long steps) {
  Runner r;
  r.name = std::move(name);
  r.time = [=, &s](int episode) { return run_episodes(*engine, s, episode, steps, NoObserver{}); };
  r.watch = [=, &s](int episode, Observer& o) {
    return run_episodes(*engine, s, episode, steps, o);
  };
  r.hash = [=](std::uint64_t seed) { return hash_of(engine->velocities(), seed); };
  return r;
}

Runner make_runner(const std::string& name, const Scenario& s, long steps) {
  if (name == "mujoco") return make_runner(name, std::make_shared<MujocoEngine>(s), s, steps);
  const Integrator integrator =
      name == "semi_implicit" ? Integrator::kSemiImplicit : Integrator::kEnergySafe;
  return make_runner(name, std::make_shared<StickslipEngine>(s, integrator), s, steps);
}

Measurement watch(Runner& runner, const Scenario& s) {
  Measurement m;
  m.engine = runner.name;
  m.microseconds = runner.microseconds;
  Observer observer(s);
  std::uint64_t hash = 0;
  for (size_t rep = 1; rep < runner.first_episode.size(); ++rep) {
    runner.watch(runner.first_episode[rep], observer);
    hash = runner.hash(hash);
  }
  m.findings = observer.finish();
  m.findings.hash = hash;
  const Findings& f = m.findings;
  const auto fault = [&](bool wrong, const std::string& what) {
    if (wrong) m.faults.push_back(what);
  };
  fault(hash != runner.state_hash, "the observed runs did not repeat the timed ones");
  fault(f.exploded > 0, std::to_string(f.exploded) + " steps exploded");
  fault(runner.name == "mujoco" && f.failed > 0, "MuJoCo warned of bad states");
  fault(!(f.bad_residual_share <= kBadResidual), "residual above 1e-8 m/s in too many steps");
  fault(!(f.base_height > s.lowest_base && f.base_height < s.highest_base),
        "base height " + std::to_string(f.base_height) + " m is not where this task ends");
  return m;
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

const Measurement* ScenarioResult::find(const std::string& engine) const {
  for (const Measurement& m : engines)
    if (m.engine == engine) return &m;
  return nullptr;
}

double ScenarioResult::ratio(const std::string& engine) const {
  const Measurement *ours = find(engine), *theirs = find("mujoco");
  if (!ours || !theirs) return 0;
  std::vector<double> ratios;
  for (size_t k = 0; k < ours->microseconds.size(); ++k)
    ratios.push_back(theirs->microseconds[k] / ours->microseconds[k]);
  return median(ratios);
}

ScenarioResult measure(const Scenario& scenario, const Settings& settings) {
  ScenarioResult result;
  result.scenario = &scenario;
  result.disagreement = model_disagreement(scenario);
  std::vector<Runner> runners;
  for (const std::string& name : settings.engines)
    runners.push_back(make_runner(name, scenario, settings.steps));

  std::vector<int> next(runners.size(), 0);
  const double wall = wall_seconds(), own = thread_seconds();
  for (int rep = 0; rep <= settings.repetitions; ++rep)  // 0 warms up
    for (size_t k = 0; k < runners.size(); ++k) {
      Runner& r = runners[k];
      r.first_episode.push_back(next[k]);
      const double start = thread_seconds();
      next[k] = r.time(next[k]);
      if (rep == 0) continue;
      r.microseconds.push_back(1e6 * (thread_seconds() - start) / settings.steps);
      r.state_hash = r.hash(r.state_hash);
    }
  result.core_share = (thread_seconds() - own) / (wall_seconds() - wall);

  for (Runner& r : runners) {
    if (settings.statistics) {
      result.engines.push_back(watch(r, scenario));
    } else {
      result.engines.push_back({r.name, r.microseconds, {}, {}});
    }
    if (!(result.disagreement < kAgreement))
      result.engines.back().faults.push_back("the engines do not simulate the same robot");
  }
  return result;
}

}  // namespace stickslip::benchmarks
