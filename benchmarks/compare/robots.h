// Other robots than ANYmal, from the package example-robot-data: measured and shown. Batches have
// an aim on one of the humanoids and one of the arms.
#pragma once
#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

/// Humanoids dropped 2 cm onto their feet, a hand thrown down with moving fingers, arms that swing
/// to random targets. `folder`: .../example-robot-data/robots.
std::vector<Scenario> robot_scenarios(const std::string& folder);

}  // namespace stickslip::benchmarks
