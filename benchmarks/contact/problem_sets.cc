#include "benchmarks/contact/problem_sets.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "scenes/problem_families.h"

namespace stickslip::benchmarks {
namespace {

struct Source {
  const char* name;
  const char* group;
  int count;
  std::function<ContactProblem(std::uint64_t seed)> make;
};

Source family(const char* name, const char* group, int count) {
  return {name, group, count,
          [name](std::uint64_t seed) { return scenes::random_problem(name, seed); }};
}

Source stacks(const char* name, double mass_ratio) {
  return {name, "stacks", 100, [mass_ratio](std::uint64_t seed) {
            scenes::BoxStackOptions options;
            options.mass_ratio = mass_ratio;
            return scenes::box_stack(seed, options);
          }};
}

const std::vector<Source>& sources() {
  static const std::vector<Source> all = {
      family("quadruped_standing", "4 feet", 1000),
      family("quadruped_impact", "4 feet", 1000),
      family("quadruped_trotting", "2 to 4 feet", 1000),
      family("eight_contacts_resting", "8 contacts", 1000),
      family("eight_contacts_impact", "8 contacts", 1000),
      family("duplicated_contacts", "duplicated", 200),
      family("ill_conditioned", "ill-conditioned", 100),
      stacks("box_stack_1", 1),
      stacks("box_stack_1e2", 1e2),
      stacks("box_stack_1e4", 1e4),
      stacks("box_stack_1e6", 1e6),
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
    const int count = std::max(10, static_cast<int>(std::lround(share * source.count)));
    for (int seed = 0; seed < count; ++seed) set.problems.push_back(source.make(seed));
    out.push_back(std::move(set));
  }
  return out;
}

}  // namespace stickslip::benchmarks
