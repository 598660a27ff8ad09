// Block systems beyond robot size, by Eigen: sparse LU where G is block sparse, blocked dense LU
// where it is full. Apart, because only this and the check for definiteness see Eigen
// (docs/theory/solvers.md (C28)).
#pragma once
#include <memory>

#include "contact/explicit_problem.h"
#include "solvers/memory.h"

namespace stickslip::solvers {

class LargeSystem {
 public:
  LargeSystem();
  ~LargeSystem();

  bool factor(const contact::ExplicitProblem& p, const Integers& active, const double* A,
              const double* B);
  void solve(double* x);

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

/// No eigenvalue of G is below -shift: G + shift is positive definite.
bool is_definite(const contact::ExplicitProblem& p, double shift);

}  // namespace stickslip::solvers
