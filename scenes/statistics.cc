#include "scenes/statistics.h"

#include <algorithm>
#include <cmath>

#include "scenes/vector.h"

namespace stickslip::scenes {

double node_energy(const Robot& robot, const WorldOptions& options) {
  if (options.integrator == Integrator::kEnergySafe) return robot.mechanical_energy();
  // T(u + g kick) = T(u) + p . g kick + m |g kick|^2 / 2
  const Vector3 change = -options.time_step / 2 * options.gravity;
  return robot.kinetic_energy() + dot(robot.linear_momentum(), change) +
         robot.model().mass() * dot(change, change) / 2 + robot.potential_energy();
}

Statistics::Statistics(const WorldOptions& options, double settle, bool track_energy)
    : options_(options), settle_(settle), track_energy_(track_energy) {}

double Statistics::mean_penetration() const {
  return penetration_count_ ? penetration_sum_ / penetration_count_ : 0;
}

void Statistics::begin(const Robot& robot) {
  ++episodes;
  time_ = 0;
  x_ = robot.q()[0];
  exploded_ = false;
  // a state that was just set is the node's, whatever the integrator
  lowest_energy_ = robot.kinetic_energy() + robot.potential_energy();
}

void Statistics::observe(const Robot& robot) {
  const double dt = options_.time_step;
  ++steps;
  time_ += dt;
  const std::span<const double> q = robot.q(), u = robot.u();

  double fastest = 0;
  for (const double rate : u)
    fastest = std::isfinite(rate) ? std::max(fastest, std::abs(rate)) : 1e300;
  max_velocity = std::max(max_velocity, fastest);
  if (fastest > 1000 && !exploded_) {
    exploded_ = true;
    ++exploded;
  }

  bool pushed[kNumLegs] = {};
  for (const Contact& c : robot.contacts())
    if (c.body > 0 && c.impulse[2] > 0) pushed[(c.body - 1) / 3] = true;

  for (int l = 0; l < kNumLegs; ++l) {
    const double depth = kFootRadius - q[2] - leg_state(l, q, u).foot[2];
    max_landing_penetration = std::max(max_landing_penetration, depth);
    if (time_ <= settle_) continue;
    max_penetration = std::max(max_penetration, depth);
    if (!(depth > 0) && !pushed[l]) continue;
    penetration_sum_ += std::max(depth, 0.0);
    ++penetration_count_;
  }

  if (track_energy_) {
    const double energy = node_energy(robot, options_);
    max_energy_growth = std::max(max_energy_growth, energy - lowest_energy_);
    lowest_energy_ = std::min(lowest_energy_, energy);
  }

  distance += q[0] - x_;
  x_ = q[0];
  for (const Contact& c : robot.contacts()) {
    if (c.body == 0 || !(c.impulse[2] > 0)) continue;
    slip += dt * std::sqrt(c.velocity[0] * c.velocity[0] + c.velocity[1] * c.velocity[1]);
  }

  const StepInfo& info = robot.info();
  contacts += info.contacts;
  sweeps += info.sweeps;
  newton_steps += info.newton_steps;
  substeps += info.substeps;
  max_residual = std::max(max_residual, info.residual);
  if (info.status != StepStatus::kOk) ++not_converged;
}

}  // namespace stickslip::scenes
