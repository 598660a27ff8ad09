// Do both engines simulate the same robot?
#pragma once
#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

/// Largest difference of mass matrix and bias force between stickslip and MuJoCo at random states
/// with fast motion, as a share of the largest entry. Above 1e-9 the models are not the same.
double model_disagreement(const Scenario& scenario);

}  // namespace stickslip::benchmarks
