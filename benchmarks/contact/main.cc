// stickslip, Pinocchio and Siconos on the same contact problems, in turns, on one core. README.md
// has the rules.
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <sstream>
#include <stdexcept>

#include "benchmarks/contact/agreement.h"
#include "benchmarks/contact/report.h"

namespace stickslip::benchmarks {
namespace {

constexpr const char* kUsage =
    "usage: stickslip_contact_compare [options]\n"
    "  --sets A,B        only sets whose name starts so (default: all)\n"
    "  --solvers A,B     only solvers whose name starts so, as in 'stickslip,pinocchio admm'\n"
    "  --share X         times the usual count of problems (default 1)\n"
    "  --rounds N        counted ones, after one that warms up (default 5)\n"
    "  --patience X      [s] a method that has taken longer for a set is not timed again (0.5)\n"
    "  --core N          pin to this core (default 1 where there is one, else 0; -1: none)\n"
    "  --json FILE       write time and residual of every problem there\n";

struct Options {
  MeasureSettings settings;
  std::vector<std::string> sets, solvers;
  std::string json;
  double share = 1;
  int core = -2;
};

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> out;
  std::stringstream stream(list);
  for (std::string item; std::getline(stream, item, ',');) out.push_back(item);
  return out;
}

double number(const std::string& name, const std::string& text, double least) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (*end || text.empty() || !(value >= least && value <= 1e6))
    throw std::invalid_argument(name + " needs a number of at least " + std::to_string(least));
  return value;
}

Options parse(int argc, char** argv) {
  Options o;
  for (int k = 1; k < argc; ++k) {
    const std::string name = argv[k];
    if (name == "--help" || k + 1 == argc) throw std::invalid_argument(kUsage);
    const std::string value = argv[++k];
    if (name == "--sets")
      o.sets = split(value);
    else if (name == "--solvers")
      o.solvers = split(value);
    else if (name == "--share")
      o.share = number(name, value, 1e-6);
    else if (name == "--rounds")
      o.settings.rounds = static_cast<int>(number(name, value, 1));
    else if (name == "--patience")
      o.settings.patience = number(name, value, 0);
    else if (name == "--core")
      o.core = static_cast<int>(number(name, value, -1));
    else if (name == "--json")
      o.json = value;
    else
      throw std::invalid_argument("unknown option " + name + "\n" + kUsage);
  }
  return o;
}

/// Sends what solvers print (Siconos: each failed factorization) to nowhere while it lives.
class Quiet {
 public:
  Quiet() {
    std::fflush(nullptr);
    const int nowhere = open("/dev/null", O_WRONLY);
    for (int k = 0; k < 2; ++k) saved_[k] = dup(k + 1), dup2(nowhere, k + 1);
    close(nowhere);
  }
  ~Quiet() {
    std::fflush(nullptr);
    for (int k = 0; k < 2; ++k) dup2(saved_[k], k + 1), close(saved_[k]);
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  int saved_[2];
};

/// Keeps this process on one core; a benchmark that wanders measures the scheduler.
void pin(int core) {
  cpu_set_t cores;
  if (core == -2) {
    if (sched_getaffinity(0, sizeof cores, &cores) != 0) return;
    core = CPU_ISSET(1, &cores) ? 1 : 0;
  }
  if (core < 0) return;
  CPU_ZERO(&cores);
  CPU_SET(core, &cores);
  if (sched_setaffinity(0, sizeof cores, &cores) != 0)
    std::printf("cannot pin to core %d: times are less steady\n", core);
}

bool starts_with_one_of(const std::string& text, const std::vector<std::string>& starts) {
  return starts.empty() || std::any_of(starts.begin(), starts.end(),
                                       [&](const std::string& s) { return text.rfind(s, 0) == 0; });
}

Methods wanted_methods(const Options& o) {
  Methods out;
  Methods some[] = {stickslip_methods(), pinocchio_methods(), siconos_methods()};
  for (Methods& methods : some)
    for (auto& method : methods)
      if (starts_with_one_of(method->solver(), o.solvers)) out.push_back(std::move(method));
  if (out.empty()) throw std::invalid_argument("--solvers names none that this program has");
  return out;
}

int run(const Options& o) {
  pin(o.core);
  const Methods methods = wanted_methods(o);
  if (!solvers_agree(methods)) return 1;
  const std::vector<ProblemSet> sets = make_problem_sets(o.sets, o.share);
  if (sets.empty()) throw std::invalid_argument("--sets names none");
  std::vector<SetResult> results;
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t busy = std::clock();
  for (const ProblemSet& set : sets) {
    SetResult r{set.name, set.group, static_cast<int>(set.problems.size()), 0, {}};
    for (const ContactProblem& p : set.problems) r.mean_contacts += p.num_contacts();
    r.mean_contacts /= r.problems;
    {
      const Quiet quiet;
      r.measurements = measure(set, methods, o.settings);
    }
    print_table(r, methods);
    results.push_back(std::move(r));
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double share =
      static_cast<double>(std::clock() - busy) / CLOCKS_PER_SEC / std::max(seconds, 1e-9);
  std::printf("\nthis program had the core %.0f %% of the time%s\n", 100 * share,
              share < 0.95 ? ": trust ratios only" : "");
  if (!o.json.empty()) write_json(o.json, results, methods);
  return 0;
}

}  // namespace
}  // namespace stickslip::benchmarks

int main(int argc, char** argv) {
  try {
    return stickslip::benchmarks::run(stickslip::benchmarks::parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
