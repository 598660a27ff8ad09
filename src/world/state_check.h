// What a state may be, for worlds and batches alike.
#pragma once
#include <stickslip/model.h>

#include <string>

namespace stickslip::world {

/// What is wrong with position q (nq) and velocity u (nu), as in "q[3] is not finite"; empty where
/// nothing is.
std::string state_fault(const Model& model, const double* q, const double* u);

/// Length of the base quaternion in q; 1 for a fixed base.
double quaternion_length(const Model& model, const double* q);

}  // namespace stickslip::world
