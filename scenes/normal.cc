#include "scenes/normal.h"

#include <cmath>

#include "scenes/portable_math.h"

namespace stickslip::scenes {
namespace {

// Finalizer of splitmix64 [Steele 2014]: a good hash of a counter.
std::uint64_t hash(std::uint64_t k) {
  std::uint64_t z = (k + 1) * 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

// Uniform in (0, 1): 53 random bits, centered so that 0 cannot occur.
double uniform(std::uint64_t k) { return (static_cast<double>(hash(k) >> 11) + 0.5) * 0x1p-53; }

}  // namespace

double normal(std::uint64_t k) {
  const std::uint64_t pair = k & ~std::uint64_t{1};
  double sine, cosine;
  sincos(6.28318530717958648 * uniform(pair + 1), sine, cosine);
  return std::sqrt(-2 * logarithm(uniform(pair))) * (k & 1 ? sine : cosine);
}

}  // namespace stickslip::scenes
