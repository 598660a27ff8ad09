#include "benchmarks/contact/problem_sets.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "contact/dense_problems.h"

namespace stickslip::benchmarks {
namespace {

using problems::Random;

/// The same contacts, each `copies` times: G becomes singular, its impulses are not unique.
ContactProblem duplicated(const ContactProblem& p, int copies) {
  const int n = p.num_contacts() * copies, m = 3 * n, m0 = 3 * p.num_contacts();
  ContactProblem out;
  out.delassus.resize(m * m), out.free_velocity.resize(m), out.friction.resize(n);
  const auto source = [&](int row) { return 3 * (row / 3 / copies) + row % 3; };
  for (int i = 0; i < m; ++i) {
    out.free_velocity[i] = p.free_velocity[source(i)];
    out.friction[i / 3] = p.friction[i / 3 / copies];
    for (int j = 0; j < m; ++j) out.delassus[i * m + j] = p.delassus[source(i) * m0 + source(j)];
  }
  return out;
}

/// 2 to 5 boxes, masses between 1 and `ratio` kg, both of which occur, in random order; pushed.
ContactProblem stack(Random& rng, double ratio) {
  const int n = 2 + rng.below(4);
  std::vector<double> masses(n);
  for (double& m : masses) m = std::pow(ratio, rng.uniform());
  const int light = rng.below(n), heavy = (light + 1 + rng.below(n - 1)) % n;
  masses[light] = 1, masses[heavy] = ratio;
  const double mu = rng.uniform(0.2, 0.9);
  return problems::tower(masses, mu, rng.uniform(0, 5) * masses.back());
}

ContactProblem robot(Random& rng, int scene) {
  return problems::dense(problems::random_robot_problem(scene, rng));
}

struct Source {
  const char* name;
  const char* group;
  int count;
  std::function<ContactProblem(Random&)> make;
};

const std::vector<Source>& sources() {
  using namespace problems;
  static const std::vector<Source> all = {
      {"feet4_stand", "4 feet", 1000, [](Random& r) { return robot(r, kStand); }},
      {"feet4_impact", "4 feet", 1000, [](Random& r) { return robot(r, kImpact); }},
      {"contacts8_rest", "8 contacts", 1000, [](Random& r) { return robot(r, kRestEight); }},
      {"contacts8_impact", "8 contacts", 1000, [](Random& r) { return robot(r, kDropEight); }},
      {"duplicated", "duplicated", 300,
       [](Random& r) { return duplicated(robot(r, kStand + r.below(2)), 2); }},
      {"stack_1", "stacks", 200, [](Random& r) { return stack(r, 1); }},
      {"stack_1e2", "stacks", 200, [](Random& r) { return stack(r, 1e2); }},
      {"stack_1e4", "stacks", 200, [](Random& r) { return stack(r, 1e4); }},
      {"stack_1e6", "stacks", 200, [](Random& r) { return stack(r, 1e6); }},
  };
  return all;
}

}  // namespace

std::vector<ProblemSet> make_problem_sets(const std::vector<std::string>& names, double share) {
  std::vector<ProblemSet> out;
  for (const Source& source : sources()) {
    const std::string name = source.name;
    const bool wanted = names.empty() || std::any_of(names.begin(), names.end(), [&](auto& start) {
                          return name.rfind(start, 0) == 0;
                        });
    if (!wanted) continue;
    ProblemSet set{name, source.group, {}};
    Random rng(out.size() + 1);
    const int count = std::max(10, static_cast<int>(std::lround(share * source.count)));
    for (int k = 0; k < count; ++k) set.problems.push_back(source.make(rng));
    out.push_back(std::move(set));
  }
  return out;
}

}  // namespace stickslip::benchmarks
