// What is measured: one solver with one setting, behind three calls of which only solve() is timed.
#pragma once
#include <stickslip/contact.h>

#include <memory>
#include <string>
#include <vector>

namespace stickslip::benchmarks {

/// A solver with a setting. Every solve starts from zero impulse.
class Method {
 public:
  Method(std::string solver, std::string setting)
      : solver_(std::move(solver)), setting_(std::move(setting)) {}
  virtual ~Method() = default;
  const std::string& solver() const { return solver_; }
  const std::string& setting() const { return setting_; }

  /// Takes a fresh copy of the problem, in the solver's own form and order. `scale` is max|c|
  /// [m/s].
  virtual void prepare(const ContactProblem& problem) = 0;
  virtual void solve() = 0;
  /// The impulse found (3n) [N s], in our order: x, y, z (normal).
  virtual std::vector<double> impulse() const = 0;

 private:
  std::string solver_, setting_;
};

using Methods = std::vector<std::unique_ptr<Method>>;

Methods stickslip_methods();
Methods pinocchio_methods();
Methods siconos_methods();  ///< empty where the program was built without Siconos

}  // namespace stickslip::benchmarks
