// Pinocchio's ADMM and PGS on a dense Delassus operator, header-only. Its order (x, y, z with z
// normal), its unknowns (impulses for velocities) and its De Saxce shift are ours; agreement.cc
// checks it.
#include <cstdio>
#include <pinocchio/algorithm/delassus-operator.hpp>
#include <pinocchio/algorithm/solvers/admm-solver.hpp>
#include <pinocchio/algorithm/solvers/pgs-solver.hpp>
#include <pinocchio/constraints.hpp>
#include <vector>

#include "benchmarks/contact/method.h"

namespace stickslip::benchmarks {
namespace {

namespace pin = pinocchio;

/// What both solvers share: the operator, g, and one friction cone per contact. Built before the
/// clock starts, although a user of Pinocchio pays for it, too.
class Pinocchio : public Method {
 public:
  using Method::Method;
  void prepare(const ContactProblem& problem) override {
    const int n = problem.num_contacts();
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    // A new damping belongs to a new problem: ADMM leaves its last one in the operator.
    delassus_.rebuild(Eigen::Map<const RowMajor>(problem.delassus.data(), 3 * n, 3 * n));
    g_ = Eigen::Map<const Eigen::VectorXd>(problem.free_velocity.data(), 3 * n);
    while (static_cast<int>(models_.size()) > n) models_.pop_back(), data_.pop_back();
    while (static_cast<int>(models_.size()) < n) {
      models_.emplace_back(robot().model, 0, pin::SE3::Identity(), robot().joint,
                           pin::SE3::Identity());
      data_.emplace_back(models_.back());
    }
    for (int i = 0; i < n; ++i) models_[i].setFriction(problem.friction[i]);
    impulse_.resize(3 * n);
  }
  std::vector<double> impulse() const override {
    return {impulse_.data(), impulse_.data() + impulse_.size()};
  }

 protected:
  pin::DelassusOperatorDense delassus_;
  Eigen::VectorXd g_, impulse_;
  std::vector<pin::PointContactConstraintModel> models_;
  std::vector<pin::PointContactConstraintData> data_;

 private:
  struct Robot {  // contact models ask for one; the solvers never look at it
    pin::Model model;
    pin::JointIndex joint;
    Robot() : joint(model.addJoint(0, pin::JointModelFreeFlyer(), pin::SE3::Identity(), "base")) {}
  };
  static const Robot& robot() {
    static const Robot one;
    return one;
  }
};

std::string setting_name(const char* rule, double tolerance, int iterations) {
  char text[64];
  std::snprintf(text, sizeof text, "%stol %.0e, %d", rule, tolerance, iterations);
  return text;
}

class Admm : public Pinocchio {
 public:
  Admm(pin::ADMMUpdateRule rule, double tolerance, int iterations)
      : Pinocchio("pinocchio admm",
                  setting_name(rule == pin::ADMMUpdateRule::OSQP ? "" : "spectral, ", tolerance,
                               iterations)),
        settings_(iterations, tolerance, tolerance, tolerance, tolerance) {
    settings_.admm_update_rule = rule;
  }
  void solve() override {
    result_.reset();
    solver_.solve(delassus_, g_, models_, data_, settings_, result_);
    result_.retrieveConstraintImpulses(impulse_);
  }

 private:
  pin::ADMMSolverSettings settings_;
  pin::ADMMConstraintSolver solver_;
  pin::ADMMSolverResult result_;
};

class Pgs : public Pinocchio {
 public:
  Pgs(double tolerance, int iterations)
      : Pinocchio("pinocchio pgs", setting_name("", tolerance, iterations)),
        settings_(iterations, tolerance, tolerance, tolerance, tolerance) {}
  void solve() override {
    result_.reset();
    solver_.solve(delassus_, g_, models_, data_, settings_, result_);
    result_.retrieveConstraintImpulses(impulse_);
  }

 private:
  pin::PGSSolverSettings settings_;
  pin::PGSConstraintSolver solver_;
  pin::PGSSolverResult result_;
};

}  // namespace

Methods pinocchio_methods() {
  using Rule = pin::ADMMUpdateRule;
  Methods out;
  out.push_back(std::make_unique<Admm>(Rule::OSQP, 1e-6, 1000));  // its defaults
  for (const Rule rule : {Rule::OSQP, Rule::SPECTRAL})
    for (const double tolerance : {1e-7, 1e-8, 1e-9, 1e-10, 1e-12})
      out.push_back(std::make_unique<Admm>(rule, tolerance, 5000));
  for (const double tolerance : {1e-8, 1e-10, 1e-12})
    out.push_back(std::make_unique<Pgs>(tolerance, 1000));
  return out;
}

}  // namespace stickslip::benchmarks
