// ln and exp without libm, whose last bit differs from machine to machine: what is drawn with a
// seed is the same everywhere. sin and cos are those of lane/math.h.
#pragma once
#include <cmath>

#include "lane/math.h"

namespace stickslip::scenes {

/// ln(x), x > 0: x = m 2^e with m in [sqrt(1/2), sqrt(2)), ln m = 2 atanh((m - 1) / (m + 1)). About
/// 1e-16 of error.
inline double logarithm(double x) {
  int exponent;
  double m = std::frexp(x, &exponent);
  if (m < 0.70710678118654752) {
    m *= 2;
    --exponent;
  }
  const double s = (m - 1) / (m + 1), s2 = s * s;
  double series = 0;
  for (int n = 21; n >= 1; n -= 2) series = series * s2 + 1.0 / n;
  return 2 * s * series + 0.69314718055994531 * exponent;
}

/// e^x, |x| < 700: x = k ln 2 + r with |r| <= ln 2 / 2, and the series of e^r. A few 1e-16 of
/// error.
inline double exponential(double x) {
  const double k = std::floor(x / 0.69314718055994531 + 0.5);
  const double r = x - k * 0.69314718055994531;
  double series = 1;
  for (int n = 15; n >= 1; --n) series = 1 + series * r / n;
  return std::ldexp(series, static_cast<int>(k));
}

}  // namespace stickslip::scenes
