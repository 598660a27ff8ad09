#include "benchmarks/compare/observer.h"

#include <cmath>
#include <cstring>

#include "model/pose.h"

namespace stickslip::benchmarks {
namespace {

constexpr double kTouch = 1e-4;     // a shape touches below this height [m]
constexpr double kExploded = 1000;  // [m/s, rad/s]

}  // namespace

double lowest_point(const Shape& s, const Pose& body) {
  const Matrix3 r = multiply(body.rotation, s.pose.rotation);
  double z = body.position[2];
  for (int k = 0; k < 3; ++k) z += body.rotation[6 + k] * s.pose.position[k];
  const double axis = std::fabs(r[8]);  // the shape's z axis against the vertical
  switch (s.type) {
    case ShapeType::kSphere:
      return z - s.size[0];
    case ShapeType::kBox:
      return z -
             0.5 * (std::fabs(r[6]) * s.size[0] + std::fabs(r[7]) * s.size[1] + axis * s.size[2]);
    case ShapeType::kCapsule:
      return z - s.size[0] - 0.5 * axis * s.size[1];
    case ShapeType::kCylinder:
      return z - s.size[0] * std::sqrt(std::fmax(0.0, 1 - axis * axis)) - 0.5 * axis * s.size[1];
    case ShapeType::kMesh:
      break;
  }
  return 1e9;
}

std::uint64_t hash_of(std::span<const double> values, std::uint64_t seed) {
  for (const double x : values) {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    for (int k = 0; k < 64; k += 8) seed = (seed ^ (bits >> k & 255)) * 1099511628211ull;
  }
  return seed;
}

Observer::Observer(const Scenario& scenario, double tolerance)
    : scenario_(&scenario), ruler_(std::make_unique<World>()) {
  found_.residuals = found_.second_opinion = Residuals(tolerance);
  ruler_->add_robot(scenario.model);
  if (!scenario.ground) return;
  for (const Shape& s : scenario.model->shapes()) {
    if (s.body == 0 || s.type == ShapeType::kMesh) continue;
    shapes_.push_back(&s);
    frames_.push_back(scenario.model->bodies()[s.body].name);
  }
}

void Observer::add(long step_of_episode) {
  const double time = step_of_episode * kTimeStep;
  ++found_.steps;
  found_.contacts += snapshot_.contacts;
  found_.pushing += snapshot_.pushing;
  found_.iterations += snapshot_.iterations;
  double fastest = 0, sum = 0;
  for (const double x : snapshot_.u) fastest = std::fmax(fastest, std::fabs(x)), sum += x;
  for (const double x : snapshot_.q) sum += x;
  found_.max_velocity = std::fmax(found_.max_velocity, fastest);
  const bool exploded = !(fastest < kExploded) || !std::isfinite(sum);
  found_.exploded += exploded;

  if (scenario_->shows_energy) {
    if (std::fabs(time - scenario_->settle) < kTimeStep / 2) {
      found_.energy_settled += snapshot_.energy;
      ++energies_settled_;
    }
    if (step_of_episode == scenario_->episode_steps) {
      found_.energy_at_end += snapshot_.energy;
      ++energies_end_;
    }
  }
  if (time <= scenario_->settle || exploded) return;
  ++settled_steps_;
  if (scenario_->model->base() == BaseType::kFloating) found_.base_height += snapshot_.q[2];
  if (!shapes_.empty()) measure_penetration();
}

void Observer::measure_penetration() {
  Robot& robot = ruler_->robot(0);
  robot.set_state(snapshot_.q, snapshot_.u);
  Pose pose;
  for (size_t k = 0; k < shapes_.size(); ++k) {
    if (k == 0 || frames_[k] != frames_[k - 1]) pose = robot.frame_pose(frames_[k]);
    const double depth = -lowest_point(*shapes_[k], pose);
    if (depth < -kTouch) continue;
    found_.mean_penetration += std::fmax(depth, 0.0);
    found_.max_penetration = std::fmax(found_.max_penetration, depth);
    ++touching_;
  }
}

Findings Observer::finish() const {
  Findings f = found_;
  const auto divide = [](double& sum, long count) { sum = count ? sum / count : 0; };
  divide(f.contacts, f.steps);
  divide(f.pushing, f.steps);
  divide(f.iterations, f.steps);
  divide(f.mean_penetration, touching_);
  divide(f.base_height, settled_steps_);
  divide(f.energy_settled, energies_settled_);
  divide(f.energy_at_end, energies_end_);
  return f;
}

}  // namespace stickslip::benchmarks
