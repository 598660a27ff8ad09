// Options of generated problems: checks, whose texts name the option, its value and its range, and
// draws of those that are not set.
#pragma once
#include <stickslip/errors.h>

#include <cmath>
#include <optional>
#include <sstream>

#include "scenes/random.h"

namespace stickslip::scenes {

template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  std::ostringstream text;
  text.precision(9);
  (text << ... << parts);
  throw ModelError(text.str());
}

template <class T>
void check_range(const char* name, T value, T lo, T hi) {
  if (!(value >= lo && value <= hi))
    refuse(name, " is ", value, "; it must lie in [", lo, ", ", hi, "]");
}

template <class T>
void check_range(const char* name, const std::optional<T>& value, T lo, T hi) {
  if (value) check_range(name, *value, lo, hi);
}

/// Zero or positive; infinite friction is a problem of its own.
inline void check_friction(const std::optional<double>& value) {
  if (value && !(*value >= 0)) refuse("friction is ", *value, "; it must be zero or positive");
}

inline void check_noise(const std::optional<double>& value) {
  if (value && (!(*value >= 0) || std::isinf(*value)))
    refuse("noise is ", *value, " m/s; it must be zero or positive");
}

inline constexpr double kMostMassRatio = 1e9;
/// Friction beyond this does not make a drawn push larger.
inline constexpr double kMostPushingFriction = 2;

inline double draw_friction(const std::optional<double>& friction, Random& rng) {
  const double drawn = rng.uniform(0.3, 1);  // also where it is not used: other draws stay the same
  return friction.value_or(drawn);
}

inline double draw_noise(const std::optional<double>& noise, Random& rng) {
  const bool still = rng.below(2) == 0;
  const double drawn = rng.log_uniform(1e-4, 0.1);
  return noise.value_or(still ? 0 : drawn);
}

}  // namespace stickslip::scenes
