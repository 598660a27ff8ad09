// Normally distributed random numbers without state and without libm: the k-th number is the same
// on every machine, in every loop, for every engine that is compared.
#pragma once
#include <cstdint>

namespace stickslip::scenes {

/// The k-th number of a fixed sequence of independent N(0, 1) numbers (splitmix64, Box and Muller).
double normal(std::uint64_t k);

}  // namespace stickslip::scenes
