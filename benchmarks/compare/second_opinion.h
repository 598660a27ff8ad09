// Contact residuals of a batch judged from outside: by the contact problem that a World in double
// precision forms at the same state. What a step reports of itself need not be believed.
#pragma once
#include <stickslip/batch.h>

#include <optional>
#include <span>

#include "benchmarks/compare/scenario.h"

namespace stickslip::benchmarks {

/// For the semi-implicit integrator: the default one has a memory that a state does not show.
class SecondOpinion {
 public:
  SecondOpinion(const Scenario& scenario, std::vector<ContactPoint> points);

  /// The largest residual [m/s] of impulses (points, 3) [N s] in the step that began at q, u with
  /// this target. Nothing where the world has other contacts: a gap within rounding of zero.
  template <class T>
  std::optional<double> residual(const T* q, const T* u, const T* target,
                                 const std::uint8_t* active, const T* impulse) {
    q_.assign(q, q + q_.size());
    u_.assign(u, u + u_.size());
    target_.assign(target, target + target_.size());
    impulse_.assign(impulse, impulse + 3 * points_.size());
    return judge(active);
  }

 private:
  std::optional<double> judge(const std::uint8_t* active);

  World world_;
  std::vector<ContactPoint> points_;
  std::vector<double> q_, u_, target_, impulse_;
};

}  // namespace stickslip::benchmarks
