// Alternating direction method of multipliers with De Saxce's shift (docs/theory/solvers.md (C50)
// to (C52)), [Carpentier 2024]: with w = tau rho,
//
//   x <- argmin 1/2 x^T G x + (c + shift) . x + eta/2 |x - x_old|^2 + w/2 |x - y - z/w|^2,
//   y <- P_K(x - z / w),   z <- z - w (x - y),   shift_i = mu |z_T|;   z tends to v + shift
// rho starts from the largest eigenvalue and doubles or halves where the residuals are out of
// balance. Coulomb's law. A method of the field to compare with, and a start for Newton steps where
// nothing else has helped.
#pragma once
#include "solvers/best_impulse.h"
#include "solvers/block_system.h"

namespace stickslip::solvers {

class Admm {
 public:
  explicit Admm(contact::ExplicitProblem& p);

  /// Starts at p.lambda, offers iterates. True once solved. Leaves p.lambda at the last iterate.
  bool run(BestImpulse& best, int max_iterations);
  int iterations() const { return iterations_; }

 private:
  bool factor(double rho);
  void multiply(const Doubles& x, Doubles& out) const;
  double largest_eigenvalue();

  contact::ExplicitProblem& p_;
  BlockSystem system_;
  Integers all_;
  Doubles A_, B_, x_, y_, z_, before_;
  double unit_ = 1;  // mean of the diagonal of G [1/kg]: the method runs on G / unit
  int iterations_ = 0;
};

}  // namespace stickslip::solvers
