// The random numbers of scenes, tests and benchmarks: a seed gives the same ones on every machine.
#pragma once
#include <cmath>
#include <cstdint>

#include "scenes/portable_math.h"

namespace stickslip::scenes {

/// splitmix64 [Steele 2014] and the distributions that problems are drawn from.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  /// In [lo, hi).
  double uniform(double lo = 0, double hi = 1) {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return lo + (hi - lo) * static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }
  /// N(0, 1), by Box and Muller.
  double normal() {
    const double u = uniform(), v = uniform();
    double sine, cosine;
    sincos(6.283185307179586 * v, sine, cosine);
    return std::sqrt(-2 * logarithm(1 - u)) * cosine;
  }
  /// In [lo, hi), its logarithm uniform; 0 < lo <= hi.
  double log_uniform(double lo, double hi) {
    return exponential(uniform(logarithm(lo), logarithm(hi)));
  }
  /// 0, 1, ..., n - 1.
  int below(int n) { return static_cast<int>(uniform() * n); }
  /// lo, lo + 1, ..., hi.
  int integer(int lo, int hi) { return lo + below(hi - lo + 1); }
  /// 1 or -1.
  double sign() { return below(2) ? 1 : -1; }

 private:
  std::uint64_t state_;
};

}  // namespace stickslip::scenes
