// Inverse functions of src/lane/math.h against libm.
#include "check.h"
#include "lane/math.h"
#include "lane/pack.h"

namespace {
double ulps(double a, double b) {
  const double spacing = std::nextafter(std::fabs(b), 1e308) - std::fabs(b);
  return std::fabs(a - b) / spacing;
}
unsigned long long state = 1;
double uniform(double lo, double hi) {
  state = state * 6364136223846793005ull + 1442695040888963407ull;
  return lo + (hi - lo) * double(state >> 11) / 9007199254740992.0;
}
}  // namespace

TEST(Atan2MeetsLibmWithinTwoUlpInAllQuadrants) {
  double worst = 0;
  for (int i = 0; i < 1000000; ++i) {
    const double y = uniform(-1, 1) * std::pow(10, uniform(-8, 8)), x = uniform(-1, 1);
    worst = std::fmax(worst, ulps(stickslip::atan2(y, x), std::atan2(y, x)));
  }
  std::printf("  worst %.2f ulp\n", worst);
  CHECK(worst <= 2);
}

TEST(Atan2OnTheAxesIsExact) {
  const double pi = 3.14159265358979323846;
  CHECK(stickslip::atan2(0.0, 0.0) == 0);
  CHECK(stickslip::atan2(0.0, 1.0) == 0);
  CHECK(stickslip::atan2(1.0, 0.0) == pi / 2);
  CHECK(stickslip::atan2(-1.0, 0.0) == -pi / 2);
  CHECK(stickslip::atan2(0.0, -1.0) == pi);
}

TEST(AcosMeetsLibmAndClipsItsArgument) {
  double worst = 0;
  for (int i = 0; i < 1000000; ++i) {
    const double x = uniform(-1, 1);
    worst = std::fmax(worst, std::fabs(stickslip::acos(x) - std::acos(x)));
  }
  std::printf("  worst %.2e\n", worst);
  CHECK(worst <= 9e-16);
  CHECK(stickslip::acos(1.0 + 1e-9) == 0);
  CHECK(stickslip::acos(-1.0 - 1e-9) == 3.14159265358979323846);
}

TEST(CbrtMeetsLibmWithinFourUlp) {
  double worst = 0;
  for (int i = 0; i < 1000000; ++i) {
    const double x = uniform(-1, 1) * std::pow(10, uniform(-60, 60));
    worst = std::fmax(worst, ulps(stickslip::cbrt(x), std::cbrt(x)));
  }
  std::printf("  worst %.2f ulp\n", worst);
  CHECK(worst <= 4);
  CHECK(stickslip::cbrt(0.0) == 0);
  CHECK(stickslip::cbrt(-27.0) == -3);
}

TEST(LanesOfAtan2AndAcosEqualTheScalarBitForBit) {
  using P = stickslip::Pack<double, 4>;
  for (int i = 0; i < 10000; ++i) {
    P y, x;
    for (int k = 0; k < 4; ++k)
      stickslip::set_lane(y, k, uniform(-2, 2)), stickslip::set_lane(x, k, uniform(-2, 2));
    const P a = stickslip::atan2(y, x), b = stickslip::acos(x);
    for (int k = 0; k < 4; ++k) {
      CHECK(stickslip::get_lane(a, k) ==
            stickslip::atan2(stickslip::get_lane(y, k), stickslip::get_lane(x, k)));
      CHECK(stickslip::get_lane(b, k) == stickslip::acos(stickslip::get_lane(x, k)));
    }
  }
}
