#include "benchmarks/compare/measure.h"

#include <stickslip/errors.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numeric>
#include <thread>

#include "benchmarks/compare/agreement.h"

namespace stickslip::benchmarks {
namespace {

constexpr double kAgreement = 1e-9;    // of the models
constexpr double kBadResidual = 1e-4;  // share of steps above the tolerance that is let pass

/// Time this process had a core [s]: others on a busy machine do not count, waiting does not exist.
/// Of all its threads, so that nobody gains who works in a thread of his own.
double cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// An engine with what it has been through.
struct Contestant {
  EngineChoice choice;
  std::unique_ptr<Runner> runner;
  std::uint64_t hash = 0;  // over the ends of all counted repetitions
  std::vector<double> microseconds;
};

struct Seconds {
  double cpu = 0, wall = 0;  // of engines timed by the CPU
};

/// One repetition.
void time(Contestant& c, bool counted, Seconds& total) {
  c.runner->prepare();
  const int parts = c.runner->parts();
  double speed = 0;  // robot-steps per second
  for (int part = 0; part < parts; ++part) {
    const auto cores = c.runner->cores(part);
    const double cpu = cpu_seconds(), took = c.runner->run(), worked = cpu_seconds() - cpu;
    if (!c.choice.wall_clock()) {
      total.cpu += worked;
      total.wall += took;
    }
    const double share = static_cast<double>(c.runner->robot_steps()) / parts;
    speed += share / (c.choice.wall_clock() ? took : worked) / parts;
  }
  // Threads of a batch stay awake for a moment, which is not the next engine's to pay for.
  if (c.choice.wall_clock()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  if (!counted) return;
  c.microseconds.push_back(1e6 / speed);
  c.hash = c.runner->hash(c.hash);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

/// The counted repetitions again, observed; returns the hash.
std::uint64_t watch(Contestant& c, Observer& observer) {
  std::uint64_t hash = 0;
  c.runner->rewind();
  for (size_t rep = 0; rep < c.microseconds.size(); ++rep) {
    c.runner->watch(observer);
    hash = c.runner->hash(hash);
  }
  return hash;
}

std::vector<std::string> faults_of(const Measurement& m, const Scenario& s) {
  std::vector<std::string> faults;
  const auto fault = [&](bool wrong, const std::string& what) {
    if (wrong) faults.push_back(what);
  };
  const Findings& f = m.findings;
  const bool ours = m.engine.kind != EngineKind::kMujoco;
  const std::string who = ours ? "stickslip" : "MuJoCo";
  char tolerance[16];
  std::snprintf(tolerance, sizeof tolerance, "%.0e", f.residuals.tolerance());
  fault(!m.watched, "the observed runs did not repeat the timed ones");
  fault(f.exploded > 0, std::to_string(f.exploded) + " steps exploded");
  fault(f.failed > 0, who + " warned of bad states");
  fault(ours && f.residuals.share_above() > kBadResidual,
        std::string("residual above ") + tolerance + " m/s in too many steps");
  fault(ours && f.residuals.unflagged() > 0, std::to_string(f.residuals.unflagged()) +
                                                 " steps with a residual above " + tolerance +
                                                 " m/s were not flagged");
  fault(!(f.base_height > s.lowest_base && f.base_height < s.highest_base),
        "base height " + std::to_string(f.base_height) + " m is not where this task ends");
  return faults;
}

/// The first batch among `engines` that takes the same steps of the same robots: it differs in what
/// shows in no bit. Null: none.
const Measurement* twin_of(const Measurement& m, const std::vector<Measurement>& engines) {
  for (const Measurement& other : engines)
    if (m.engine.kind == EngineKind::kBatch && other.engine.kind == EngineKind::kBatch &&
        m.engine.precision == other.engine.precision &&
        m.engine.integrator == other.engine.integrator && m.robots == other.robots &&
        m.robot_steps == other.robot_steps && m.microseconds.size() == other.microseconds.size())
      return &other;
  return nullptr;
}

/// What c was timed at, and by `earlier` engines or a second look what it did.
Measurement measurement_of(Contestant& c, const std::vector<Measurement>& earlier,
                           const Scenario& scenario, bool statistics) {
  Measurement m;
  m.engine = c.choice;
  m.robots = c.runner->robots();
  m.robot_steps = c.runner->robot_steps();
  m.instruction_set = c.runner->instruction_set();
  m.microseconds = c.microseconds;
  m.hash = c.hash;
  const Measurement* twin = twin_of(m, earlier);
  const bool same_bits = twin && twin->hash == m.hash;
  if (statistics && same_bits && twin->watched) {
    m.findings = twin->findings;
    m.watched = true;
  } else if (statistics) {
    Observer observer(scenario, c.choice.tolerance());
    m.watched = watch(c, observer) == c.hash;
    m.findings = observer.finish();
  }
  if (statistics) m.faults = faults_of(m, scenario);
  if (twin && !same_bits) m.faults.push_back("it ends in other bits than " + twin->engine.name);
  return m;
}

}  // namespace

double Measurement::microseconds_per_step() const {
  if (microseconds.empty()) return 0;
  if (engine.wall_clock()) return median(microseconds);
  return std::accumulate(microseconds.begin(), microseconds.end(), 0.0) /
         static_cast<double>(microseconds.size());
}

const Measurement* ScenarioResult::find(const std::string& engine) const {
  for (const Measurement& m : engines)
    if (m.engine.name == engine) return &m;
  return nullptr;
}

double ScenarioResult::ratio(const Measurement& m) const {
  const Measurement* theirs = find(aim(m).against);
  if (!theirs || theirs->microseconds.size() != m.microseconds.size() || m.microseconds.empty())
    return 0;
  if (!m.engine.wall_clock()) return theirs->microseconds_per_step() / m.microseconds_per_step();
  std::vector<double> ratios;
  for (size_t k = 0; k < m.microseconds.size(); ++k)
    ratios.push_back(theirs->microseconds[k] / m.microseconds[k]);
  return median(ratios);
}

bool ScenarioResult::misses_aim(const Measurement& m) const {
  // Without the other engine in the run there is nothing to miss.
  const double reached = ratio(m);
  return reached > 0 && reached < aim(m).ratio;
}

ScenarioResult measure(const Scenario& scenario, const Settings& settings) {
  ScenarioResult result;
  result.scenario = &scenario;
  result.disagreement = model_disagreement(scenario);
  std::vector<Contestant> contestants;
  for (const EngineChoice& choice : settings.engines) {
    try {
      contestants.push_back({choice, make_runner(choice, scenario, settings), 0, {}});
    } catch (const ModelError& error) {  // such as an instruction set that is not there
      result.engines.emplace_back();
      result.engines.back().engine = choice;
      result.engines.back().faults = {error.what()};
    }
  }

  // Who comes after whom must not decide: those on the wall clock take turns in being the first.
  std::vector<Contestant*> on_the_wall;
  for (Contestant& c : contestants)
    if (c.choice.wall_clock()) on_the_wall.push_back(&c);
  Seconds total;
  size_t turn = 0;
  for (int rep = 0; rep <= settings.repetitions; ++rep) {  // 0 warms up
    if (rep == 1)
      for (Contestant& c : contestants) c.runner->mark();
    for (Contestant& c : contestants)
      if (!c.choice.wall_clock()) time(c, rep > 0, total);
    for (int round = 0; round < Settings::kThreadRounds; ++round, ++turn)
      for (size_t k = 0; k < on_the_wall.size(); ++k)
        time(*on_the_wall[(turn + k) % on_the_wall.size()], rep > 0, total);
  }
  if (total.wall > 0) result.core_share = total.cpu / total.wall;

  for (Contestant& c : contestants) {
    result.engines.push_back(measurement_of(c, result.engines, scenario, settings.statistics));
    if (!(result.disagreement < kAgreement))
      result.engines.back().faults.push_back("the engines do not simulate the same robot");
  }
  return result;
}

}  // namespace stickslip::benchmarks
