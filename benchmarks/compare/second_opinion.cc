#include "benchmarks/compare/second_opinion.h"

#include <algorithm>

#include "benchmarks/compare/stickslip_loop.h"

namespace stickslip::benchmarks {

SecondOpinion::SecondOpinion(const Scenario& s, std::vector<ContactPoint> points)
    : world_(make_world(s, Integrator::kSemiImplicit)),
      points_(std::move(points)),
      q_(s.model->nq()),
      u_(s.model->nu()),
      target_(s.model->num_joints()) {}

std::optional<double> SecondOpinion::judge(const std::uint8_t* active) {
  Robot& robot = world_.robot(0);
  robot.set_state(q_, u_);
  robot.set_pd_target(target_);
  world_.step();
  const auto number = std::count_if(active, active + points_.size(), [](auto a) { return a != 0; });
  if (number != static_cast<long>(robot.contacts().size())) return {};
  if (number == 0) return 0;
  std::vector<double> given;
  for (const Contact& c : robot.contacts()) {
    const auto same = std::find_if(points_.begin(), points_.end(), [&](const ContactPoint& p) {
      return p.shape == c.shape && p.point == c.point;
    });
    const auto k = same - points_.begin();
    if (same == points_.end() || !active[k]) return {};
    given.insert(given.end(), &impulse_[3 * k], &impulse_[3 * k] + 3);
  }
  const std::vector<double> all = stickslip::residual(world_.last_contact_problem(0), given);
  return *std::max_element(all.begin(), all.end());
}

}  // namespace stickslip::benchmarks
