// Arrays of lanes as the step uses them.
#include <limits>

#include "check.h"
#include "lane/pack.h"
#include "step/lane_arrays.h"

using namespace stickslip;

namespace {

/// Puts `x` at every place of arrays of every length; the answers of the lane it is in and of
/// another.
template <class S>
void check_are_finite(Value<S> x, bool expected) {
  constexpr int kMost = 9, kWidth = ScalarTraits<S>::kWidth;
  for (int n = 1; n <= kMost; ++n)
    for (int at = 0; at < n; ++at)
      for (int lane = 0; lane < kWidth; ++lane) {
        S values[kMost];
        for (S& v : values) v = constant<S>(-2);
        set_lane(values[at], lane, x);
        const Mask<S> found = step::are_finite(values, n);
        for (int other = 0; other < kWidth; ++other)
          CHECK(get_lane(found, other) == (other == lane ? expected : true));
      }
}

template <class S>
void check_are_finite() {
  using Limits = std::numeric_limits<Value<S>>;
  check_are_finite<S>(Limits::quiet_NaN(), false);
  check_are_finite<S>(Limits::infinity(), false);
  check_are_finite<S>(-Limits::infinity(), false);
  check_are_finite<S>(Limits::max(), true);
  check_are_finite<S>(Limits::denorm_min(), true);
  check_are_finite<S>(0, true);
  // Whose sum would not be finite.
  S values[6];
  for (S& v : values) v = S(Limits::max());
  CHECK(all(step::are_finite(values, 6)));
}

}  // namespace

TEST(NumbersAreFiniteLaneByLaneWhereverTheyStand) {
  check_are_finite<double>();
  check_are_finite<float>();
  check_are_finite<Pack<double, 4>>();
  check_are_finite<Pack<float, 8>>();
}
