// A Newton step that takes the contacts of a body together: it is the step over all dofs, and each
// lane of a pack takes the one that it would take alone, bit for bit.
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "contact/body_problems.h"

using namespace body_problems;

namespace {

/// Two sweeps and a Newton step of this proximal weight, twice; lanes in `once` are left out the
/// second time.
template <class S>
void iterate(FactoredProblem<S>& p, bool by_bodies, double weight, Mask<S> once) {
  const S alpha = constant<S>(weight), fine = constant<S>(1e-10);
  const Mask<S> all = alpha > constant<S>(0);
  const Mask<S> lives[] = {all, Mask<S>(all & !once)};
  for (const Mask<S> live : lives) {
    for (int k = 0; k < 2; ++k) sweep<0, false>(p, live, fine);
    if (by_bodies)
      newton_step_by_bodies(p, live, alpha);
    else
      newton_step<0>(p, live, alpha);
  }
}

/// Sweeps and Newton steps, every other lane with fewer of them.
template <class Wide>
void compare_steps(unsigned seed) {
  compare_lanes<Wide>(seed, 500, [](auto& p, const std::vector<int>& lanes, int) {
    using S = std::decay_t<decltype(p.w[0])>;
    S odd = constant<S>(0);
    for (size_t l = 0; l < lanes.size(); ++l) set_lane(odd, int(l), Value<S>(lanes[l] % 2));
    iterate(p, true, 1e-4, odd > constant<S>(0));
    return std::vector<S>{certify<0, false>(p)};
  });
}

/// Differences between the results of steps by bodies and over all dofs as shares of their size,
/// ascending.
std::vector<double> errors_of_bodies(double alpha) {
  Owned<double> bodies(kCapacity), dofs(kCapacity);
  Random rng(3);
  std::vector<double> errors;
  for (int n = 0; n < 4000; ++n) {
    const Robot robot = random_lanes(1, rng);
    build(bodies.p, robot, {0});
    build(dofs.p, robot, {0});
    iterate(bodies.p, true, alpha, false);
    iterate(dofs.p, false, alpha, false);
    const std::vector<double> got = result(bodies.p, {certify<0, false>(bodies.p)}),
                              expected = result(dofs.p, {certify<0, false>(dofs.p)});
    double size = 1, error = 0;
    for (size_t k = 0; k < got.size(); ++k) {
      size = std::fmax(size, std::fabs(expected[k]));
      error = std::fmax(error, std::fabs(got[k] - expected[k]));
    }
    errors.push_back(error / size);
  }
  std::sort(errors.begin(), errors.end());
  std::printf("  alpha %.0e: median error %.1e, 99 %% %.1e, largest %.1e\n", alpha, errors[2000],
              errors[3960], errors[3999]);
  return errors;
}

}  // namespace

TEST(StepsByBodiesAreThoseOverAllDofs) {
  CHECK(errors_of_bodies(1e-4).back() < 1e-7);
  // Some of the problems are singular but for the proximal weight.
  const std::vector<double> errors = errors_of_bodies(default_options<double>().alpha);
  CHECK(errors[3960] < 1e-7 && errors.back() < 1e-3);
}

TEST(LanesTakeTheStepsOfThePlainScalar) {
  compare_steps<Pack<double, 4>>(4);
  compare_steps<Pack<float, 8>>(5);
  compare_steps<Pack<float, 16>>(6);
}
