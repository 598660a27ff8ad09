// Solves that take the contacts of a body together: each lane of a pack ends where it would end
// alone, bit for bit, whatever the others need.
#include <type_traits>

#include "contact/body_problems.h"

using namespace body_problems;

namespace {

/// Makes the first contact of a lane not finite.
template <class S>
void spoil(FactoredProblem<S>& p, int lane) {
  for (int i = 0; i < p.size(); ++i)
    if (get_lane(p.contact(i).active, lane))
      return set_lane(p.contact(i).offset[2], lane, Value<S>(__builtin_nan("")));
}

/// How the solves of single lanes ended.
struct Ends {
  int without_newton = 0, at_third_sweep = 0, with_newton = 0, fallbacks = 0, spoiled = 0;
};

/// In every fifth problem a lane is not finite.
template <class Wide>
void compare_solves(unsigned seed, bool foresee) {
  Ends ends;
  compare_lanes<Wide>(seed, 150, [&](auto& p, const std::vector<int>& lanes, int n) {
    using S = std::decay_t<decltype(p.w[0])>;
    for (size_t l = 0; l < lanes.size(); ++l)
      if (n % 5 == 0 && lanes[l] == 1) spoil(p, int(l));
    auto options = default_options<S>();
    options.foresee = foresee;
    const auto info = solve_factored(p, options);
    if (lanes.size() == 1) {
      ends.without_newton += info.newton_steps == 0;
      ends.at_third_sweep += info.newton_steps == 0 && info.sweeps == 3;
      ends.with_newton += info.newton_steps > 0;
      ends.fallbacks += info.fallbacks;
      ends.spoiled += !(get_lane(info.residual, 0) >= 0);
    }
    for (int i = 0; i < p.size(); ++i) set_impulse(p.contact(i), p.impulse(i));
    return std::vector<S>{info.residual, select(info.converged, constant<S>(1), constant<S>(0))};
  });
  std::printf(
      "  solves without Newton steps %d, of those %d in three sweeps; with %d; fallbacks %d; "
      "not finite %d\n",
      ends.without_newton, ends.at_third_sweep, ends.with_newton, ends.fallbacks, ends.spoiled);
  CHECK(ends.at_third_sweep > 10 && ends.with_newton > 100 && ends.fallbacks > 5);
  CHECK(ends.spoiled > 20);
}

}  // namespace

TEST(LanesEndWhereThePlainScalarDoes) {
  compare_solves<Pack<double, 4>>(7, true);
  compare_solves<Pack<double, 4>>(8, false);
  compare_solves<Pack<float, 8>>(9, false);
}

TEST(LanesOfTheWidestPacksDoToo) {
  compare_solves<Pack<double, 8>>(10, true);
  compare_solves<Pack<float, 16>>(11, false);
}
