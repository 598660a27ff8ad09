// Generated problems, and what the tests of the public API need of them.
#pragma once
#include <stickslip/contact.h>

#include <cmath>
#include <vector>

#include "scenes/problem_families.h"

namespace problems {

using namespace stickslip::scenes;

inline double largest(const std::vector<double>& x) {
  double worst = 0;
  for (double e : x) worst = std::fmax(worst, std::fabs(e));
  return worst;
}

}  // namespace problems
