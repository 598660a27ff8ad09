// The linear systems of all methods: (A + B G) x = f with block-diagonal A and B, over the contacts that
// take part. Newton steps, interior-point steps and ADMM differ in A and B only.
#pragma once
#include <memory>
#include <vector>

#include "contact/explicit_problem.h"

namespace stickslip::solvers {

class LargeSystem;

class BlockSystem {
 public:
  BlockSystem();
  ~BlockSystem();
  BlockSystem(const BlockSystem&) = delete;
  BlockSystem& operator=(const BlockSystem&) = delete;

  /// Factors the rows and columns of the contacts in `active` (ascending). A, B: (n, 3, 3) row-major,
  /// of all contacts. False where a library finds no factors.
  bool factor(const contact::ExplicitProblem& p, const std::vector<int>& active, const double* A,
              const double* B);
  /// x <- solution, for x (3 active) in the order of `active`; not finite where the matrix was
  /// singular.
  void solve(double* x);

  /// Rows up to which the own dense factors are used, which do not allocate once they are that large.
  static constexpr int kDenseRows = 150;

 private:
  void assemble_dense(const contact::ExplicitProblem& p, const std::vector<int>& active,
                      const double* A, const double* B);

  int size_ = 0;
  bool large_ = false;
  std::vector<double> matrix_;
  std::vector<int> pivot_;
  std::unique_ptr<LargeSystem> library_;
};

}  // namespace stickslip::solvers
