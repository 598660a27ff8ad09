// stickslip and MuJoCo on the same tasks, interleaved, on one core. README.md has the rules.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <sstream>

#include "benchmarks/compare/cores.h"
#include "benchmarks/compare/report.h"
#include "benchmarks/compare/robots.h"

namespace stickslip::benchmarks {
namespace {

constexpr const char* kUsage =
    "usage: stickslip_compare [options]\n"
    "  --tasks A,B         only tasks whose name starts so, any case (default: all)\n"
    "  --engines A,B       of mujoco; one robot: semi_implicit, energy_safe; many robots:\n"
    "                      "
    "batch_<float32|float64>[_energy_safe][_avx2|_avx512|_neon][_ungrouped]\n"
    "                      [_threads<N>|_apart<N>]\n"
    "                      (default: what benchmarks/README.md lists)\n"
    "  --robots-per-batch N   a multiple of 16 (default 64)\n"
    "  --steps N           per repetition (default 2000); a batch takes 16 N robot-steps, where\n"
    "                      threads are compared 3 times about 40 N\n"
    "  --repetitions N     counted ones; one more warms up (default 40)\n"
    "  --robots FOLDER     example-robot-data's robots folder: adds other robots than ANYmal\n"
    "  --urdf FILE         ANYmal's description\n"
    "  --core N            pin to this core (default: the second of those there are; -1: none)\n"
    "  --no-statistics     times, and who must end in the same bits; nothing is watched\n"
    "  --check             fail (exit status 1) where an aim is missed, too\n"
    "  --json FILE         write the results there too\n";

struct Options {
  Settings settings;
  std::vector<std::string> tasks;
  std::string urdf = STICKSLIP_ANYMAL, robots, json;
  int core = -2;
  bool check = false;
};

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> out;
  std::stringstream stream(list);
  for (std::string item; std::getline(stream, item, ',');) out.push_back(item);
  return out;
}

long positive(const std::string& name, const std::string& text) {
  char* end = nullptr;
  const long value = std::strtol(text.c_str(), &end, 10);
  if (*end || value < 1) throw std::invalid_argument(name + " needs a positive number");
  return value;
}

Options parse(int argc, char** argv) {
  Options o;
  for (int k = 1; k < argc; ++k) {
    const std::string name = argv[k];
    if (name == "--no-statistics") {
      o.settings.statistics = false;
      continue;
    }
    if (name == "--check") {
      o.check = true;
      continue;
    }
    if (name == "--help" || k + 1 == argc) throw std::invalid_argument(kUsage);
    const std::string value = argv[++k];
    if (name == "--tasks")
      o.tasks = split(value);
    else if (name == "--engines")
      for (const std::string& e : split(value)) o.settings.engines.push_back(engine_choice(e));
    else if (name == "--robots-per-batch")
      o.settings.robots = static_cast<int>(positive(name, value));
    else if (name == "--steps")
      o.settings.steps = positive(name, value);
    else if (name == "--repetitions")
      o.settings.repetitions = static_cast<int>(positive(name, value));
    else if (name == "--robots")
      o.robots = value;
    else if (name == "--urdf")
      o.urdf = value;
    else if (name == "--json")
      o.json = value;
    else if (name == "--core")
      o.core = std::atoi(value.c_str());
    else
      throw std::invalid_argument("unknown option " + name + "\n" + kUsage);
  }
  auto& engines = o.settings.engines;
  if (engines.empty())
    for (const std::string& e : default_engines()) engines.push_back(engine_choice(e));
  if (o.settings.robots % Settings::kFullPack)
    throw std::invalid_argument("--robots-per-batch needs a multiple of 16: full packs");
  if (o.check &&
      std::ranges::none_of(engines, [](const auto& e) { return e.kind == EngineKind::kMujoco; }))
    throw std::invalid_argument("--check needs mujoco among the engines: aims are ratios to it");
  return o;
}

bool wanted(const Scenario& s, const std::vector<std::string>& tasks) {
  const auto starts_so = [&](const std::string& t) {
    return t.size() <= s.name.size() && strncasecmp(s.name.c_str(), t.c_str(), t.size()) == 0;
  };
  return tasks.empty() || std::any_of(tasks.begin(), tasks.end(), starts_so);
}

int run(const Options& o) {
  std::vector<Scenario> scenarios = anymal_scenarios(o.urdf);
  if (!o.robots.empty())
    for (Scenario& s : robot_scenarios(o.robots)) scenarios.push_back(std::move(s));
  std::erase_if(scenarios, [&](const Scenario& s) { return !wanted(s, o.tasks); });
  if (scenarios.empty()) throw std::invalid_argument("no such task");

  const int core = pin(o.core);
  std::printf(
      "one thread (but for _threads, _apart), core %d, dt = 1 ms, %ld steps x %d repetitions, "
      "in turns; batches of %d robots\n\n",
      core, o.settings.steps, o.settings.repetitions, o.settings.robots);
  print_header();
  std::vector<ScenarioResult> results;
  bool good = true;
  double least_share = NAN, disagreement = 0;
  for (const Scenario& s : scenarios) {
    results.push_back(measure(s, o.settings));
    print_result(results.back());
    good = print_faults(results.back()) && good;
    least_share = std::fmin(least_share, results.back().core_share);
    disagreement = std::max(disagreement, results.back().disagreement);
  }
  print_second_opinions(results);
  if (o.check) good = print_missed_aims(results) && good;
  std::printf("\nmodels agree to %.1e", disagreement);
  if (std::isfinite(least_share))
    std::printf("; this thread had the core at least %.0f %% of the time", 100 * least_share);
  std::printf("\n");
  if (!o.json.empty()) {
    std::ofstream file(o.json);
    file << to_json(results, o.settings);
    if (!file.flush()) throw std::runtime_error("cannot write " + o.json);
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace stickslip::benchmarks

int main(int argc, char** argv) {
  try {
    return stickslip::benchmarks::run(stickslip::benchmarks::parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stickslip_compare: %s\n", error.what());
    return 2;
  }
}
