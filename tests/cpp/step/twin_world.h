// A world that is never alone: a float64 batch of the same scene does every step beside it and must
// have its bits, so that what a test shows of the world it shows of the batch.
#pragma once
#include <stickslip/batch.h>

#include <algorithm>
#include <optional>

#include "check.h"
#include "step/bodies.h"

namespace bodies {

/// Compared are worlds that a batch can hold: one robot, solved by kAuto. State, gains, targets and
/// forces may change between steps as in a World; after a change of materials, a ground or a robot,
/// the comparison goes on with the next `set_state`, because a batch begins without warm starts.
class TwinWorld : public World {
 public:
  using World::World;

  void add_ground(double height = 0, const std::string& material = "default") {
    World::add_ground(height, material);
    batch_.reset();
  }
  Robot& add_robot(ModelPtr model, const RobotOptions& robot_options = {}) {
    batch_.reset();
    return World::add_robot(std::move(model), robot_options);
  }
  void set_material_pair(const std::string& a, const std::string& b, const MaterialPair& pair) {
    World::set_material_pair(a, b, pair);
    batch_.reset();
  }

  /// No batch from here on: for crowds of worlds of which some are enough.
  void go_alone() { alone_ = true; }

  StepStatus step(int steps = 1) {
    if (alone_ || num_robots() != 1 || options().solver.method != SolveMethod::kAuto || steps < 1)
      return World::step(steps);
    Robot& r = robot(0);
    const bool placed = !same_bits(last_.q, r.q()) || !same_bits(last_.u, r.u());
    if (placed) place(r);
    if (batch_) copy_inputs(r);
    const StepStatus status = World::step(steps);
    last_ = {copy(r.q()), copy(r.u())};
    if (batch_) {
      const StepStatus other = batch_->step(steps);
      const char* field = status != other ? "status" : difference(r, steps);
      if (field) std::printf("  the batch beside a world has another %s\n", field);
      CHECK(!field);
      if (field) batch_.reset();
      compared() += steps;
    }
    return status;
  }

  /// Steps of this program that were compared.
  static long& compared() {
    static long n = 0;
    return n;
  }

 private:
  template <class T>
  std::span<T> row(BatchField field) {
    const BatchArray array = batch_->array(field);
    size_t n = 1;
    for (const int k : array.shape) n *= static_cast<size_t>(k);
    return {static_cast<T*>(array.data), n};
  }
  void set(BatchField field, std::span<const double> values) {
    const auto to = row<double>(field);
    std::copy(values.begin(), values.end(), to.begin());
  }

  /// Both begin at the robot's state. Each normalizes a quaternion on its way in, so both take it
  /// the same way.
  void place(Robot& r) {
    const State s{copy(r.q()), copy(r.u())};
    if (batch_) {
      const std::int64_t first = 0;
      batch_->reset({&first, 1}, s.q, s.u);
    } else {
      BatchOptions o;
      o.precision = Precision::kFloat64;
      o.num_threads = 1;
      batch_.emplace(*this, o);
      gains_ = {copy(r.pd_kp()), copy(r.pd_kd())};
      forced_ = false;
    }
    r.set_state(s.q, s.u);
  }

  /// Parameters stay shared, and forces unused, until a test changes them.
  void copy_inputs(const Robot& r) {
    set(BatchField::kPdTarget, r.pd_target());
    if (!same_bits(gains_.q, r.pd_kp()) || !same_bits(gains_.u, r.pd_kd())) {
      set(BatchField::kKp, r.pd_kp());
      set(BatchField::kKd, r.pd_kd());
      gains_ = {copy(r.pd_kp()), copy(r.pd_kd())};
    }
    forced_ = forced_ || largest(r.generalized_force()) > 0;
    if (forced_) set(BatchField::kGeneralizedForce, r.generalized_force());
  }

  const char* difference(const Robot& r, int steps) {
    if (!same_bits(row<double>(BatchField::kQ), r.q())) return "q";
    if (!same_bits(row<double>(BatchField::kU), r.u())) return "u";
    if (steps == 1 && row<double>(BatchField::kResidual)[0] != r.info().residual) return "residual";
    const std::vector<ContactPoint>& points = batch_->contact_points();
    const auto active = row<std::uint8_t>(BatchField::kContactActive);
    const auto impulse = row<double>(BatchField::kContactImpulse);
    if (std::count(active.begin(), active.end(), 1) != std::ssize(r.contacts())) return "contact";
    for (const Contact& c : r.contacts())
      for (size_t k = 0; k < points.size(); ++k)
        if (points[k].shape == c.shape && points[k].point == c.point &&
            (!active[k] || !std::equal(c.impulse.begin(), c.impulse.end(), &impulse[3 * k])))
          return "contact impulse";
    return nullptr;
  }

  std::optional<Batch> batch_;
  State last_;   // after the last step
  State gains_;  // kp, kd of the batch
  bool forced_ = false, alone_ = false;
};

}  // namespace bodies
