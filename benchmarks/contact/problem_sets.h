// The sets of problems: families of scenes/problem_families.h, seeds 0, 1, 2, ...
#pragma once
#include <stickslip/contact.h>

#include <string>
#include <vector>

namespace stickslip::benchmarks {

struct ProblemSet {
  std::string name;
  std::string group;  ///< sets of one group share the aims: "4 feet", "8 contacts", ...
  std::vector<ContactProblem> problems;
};

/// Sets whose name starts with one of `names` (empty: all), `share` times as many problems as usual
/// in each, at least 10.
std::vector<ProblemSet> make_problem_sets(const std::vector<std::string>& names, double share);

}  // namespace stickslip::benchmarks
