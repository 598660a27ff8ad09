// How a base turns in a step, against the exponential map in long double.
#include <algorithm>
#include <cmath>
#include <random>

#include "check.h"
#include "step/control.h"

using namespace stickslip;

namespace {

step::RobotTables floating_body() {
  step::RobotTables tables{};
  tables.floating = true;
  return tables;
}

/// Largest error of cos t and sin(t) / t for t^2 up to `largest`.
template <class S>
double error_of_series(double largest) {
  long double worst = 0;
  for (int k = 0; k <= 60000; ++k) {
    const Value<S> t2 = static_cast<Value<S>>(k * largest / 60000);
    const long double t = std::sqrt(static_cast<long double>(t2));
    S cosine, sinc;
    cos_and_sinc(S(t2), cosine, sinc);
    const long double wanted = t > 0 ? std::sin(t) / t : 1;
    worst = std::max({worst, std::fabs(get_lane(cosine, 0) - std::cos(t)),
                      std::fabs(get_lane(sinc, 0) - wanted)});
  }
  return static_cast<double>(worst);
}

/// Turns of up to `largest` [rad]; worst error of the quaternion and of its length.
template <class S>
double error_of_turns(double largest) {
  const step::RobotTables tables = floating_body();
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  long double worst = 0;
  for (int i = 0; i < 2000; ++i) {
    double start[4], axis[3];
    for (double& x : start) x = normal(rng);
    for (double& x : axis) x = normal(rng);
    const double size = std::hypot(std::hypot(start[0], start[1]), std::hypot(start[2], start[3]));
    const double length = std::hypot(axis[0], axis[1], axis[2]);
    const double rate = uniform(rng) * largest / 0.01;
    S q[7] = {}, v[6] = {}, to[7];
    for (int k = 0; k < 4; ++k) q[3 + k] = static_cast<S>(start[k] / size);
    for (int k = 0; k < 3; ++k) v[3 + k] = static_cast<S>(axis[k] / length * rate);
    step::integrate_configuration(tables, q, v, static_cast<S>(0.01), to);
    const long double h = static_cast<S>(0.01);
    const long double r[3] = {h * v[3] / 2, h * v[4] / 2, h * v[5] / 2};
    const long double t = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    const long double c = std::cos(t), s = t > 0 ? std::sin(t) / t : 1;
    const long double w = q[3], x = q[4], y = q[5], z = q[6];
    const long double e[3] = {s * r[0], s * r[1], s * r[2]};
    long double wanted[4] = {
        c * w - e[0] * x - e[1] * y - e[2] * z, c * x + e[0] * w + e[1] * z - e[2] * y,
        c * y + e[1] * w + e[2] * x - e[0] * z, c * z + e[2] * w + e[0] * y - e[1] * x};
    long double square = 0, unit = 0;
    for (int k = 0; k < 4; ++k)
      square += wanted[k] * wanted[k], unit += (long double)to[3 + k] * to[3 + k];
    for (int k = 0; k < 4; ++k)
      worst = std::max(worst, std::fabs(to[3 + k] - wanted[k] / std::sqrt(square)));
    worst = std::max(worst, std::fabs(std::sqrt(unit) - 1));
  }
  return static_cast<double>(worst);
}

}  // namespace

TEST(CosineAndSincAreGoodToHalfAnUlpOfOneWhereSeriesMakeThem) {
  CHECK(error_of_series<double>(0.0625) < 7e-17);
  CHECK(error_of_series<float>(0.0625) < 3.5e-8);
  CHECK(error_of_series<double>(9) < 4e-16);
  CHECK(error_of_series<float>(9) < 2e-7);
  CHECK((error_of_series<Pack<double, 4>>(9) == error_of_series<double>(9)));
  CHECK((error_of_series<Pack<float, 8>>(9) == error_of_series<float>(9)));
}

/// Lanes in the series and beyond, near unit length and far from it, side by side.
template <class S>
void check_mixed_lanes() {
  constexpr int kWidth = ScalarTraits<S>::kWidth;
  using T = Value<S>;
  S t2, cosine, sinc, q[4];
  for (int lane = 0; lane < kWidth; ++lane) {
    set_lane(t2, lane, static_cast<T>(lane % 3 == 1 ? 2.0 + lane : 0.007 * lane));
    for (int k = 0; k < 4; ++k)
      set_lane(q[k], lane, static_cast<T>((0.5 + 1e-9 * k) * (lane % 2 ? 1 + lane : 1)));
  }
  cos_and_sinc(t2, cosine, sinc);
  S unit[4] = {q[0], q[1], q[2], q[3]};
  step::normalize(unit);
  for (int lane = 0; lane < kWidth; ++lane) {
    T c, s, alone[4];
    cos_and_sinc(get_lane(t2, lane), c, s);
    CHECK(get_lane(cosine, lane) == c && get_lane(sinc, lane) == s);
    for (int k = 0; k < 4; ++k) alone[k] = get_lane(q[k], lane);
    step::normalize(alone);
    for (int k = 0; k < 4; ++k) {
      CHECK(get_lane(unit[k], lane) == alone[k]);
      CHECK_NEAR(alone[k], 0.5, sizeof(T) == 4 ? 1e-7 : 3e-9);
    }
  }
}

TEST(LanesOfBothKindsSideBySideHaveTheBitsOfOneAlone) {
  check_mixed_lanes<Pack<double, 4>>();
  check_mixed_lanes<Pack<double, 8>>();
  check_mixed_lanes<Pack<float, 8>>();
  check_mixed_lanes<Pack<float, 16>>();
}

TEST(TurnsFollowTheExponentialMap) {
  for (const double largest : {1e-6, 0.1, 1.0, 6.0}) {
    CHECK(error_of_turns<double>(largest) < 1e-15);
    CHECK(error_of_turns<float>(largest) < 5e-7);
  }
}

TEST(QuaternionsThatAreNotNearUnitLengthAreBroughtThere) {
  for (const double factor : {1e-30, 0.5, 1 + 1e-6, 1.001, 3.0, 1e30}) {
    double q[4] = {0.5 * factor, -0.5 * factor, 0.5 * factor, 0.5 * factor};
    step::normalize(q);
    for (int k = 0; k < 4; ++k) CHECK_NEAR(q[k], k == 1 ? -0.5 : 0.5, 2e-16);
  }
}

TEST(TurnsTooFastToFollowAreNoQuaternionOfZeros) {
  const step::RobotTables tables = floating_body();
  for (double rate = 1e10; rate < 1e308; rate *= 10) {
    double q[7] = {0, 0, 0, 1, 0, 0, 0}, v[6] = {0, 0, 0, rate, 0, 0}, to[7];
    step::integrate_configuration(tables, q, v, 0.001, to);
    const double length = std::hypot(std::hypot(to[3], to[4]), std::hypot(to[5], to[6]));
    CHECK(std::isnan(length) || std::fabs(length - 1) < 1e-12);
  }
}
