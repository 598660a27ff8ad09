// The linear systems of all methods: (A + B G) x = f with block-diagonal A and B, over the contacts
// that take part. Newton steps, interior-point steps and ADMM differ in A and B only
// (docs/theory/solvers.md (C28)).
#pragma once
#include <memory>

#include "contact/explicit_problem.h"
#include "solvers/memory.h"

namespace stickslip::solvers {

class LargeSystem;

class BlockSystem {
 public:
  /// For systems of up to that many contacts.
  BlockSystem(int contacts, Memory memory);
  ~BlockSystem();
  BlockSystem(const BlockSystem&) = delete;
  BlockSystem& operator=(const BlockSystem&) = delete;

  /// x <- solution for one right-hand side x (3 active), in the order of `active`: what `factor`
  /// and `solve` do, faster for systems of robot size. False where a library finds no factors; not
  /// finite where the matrix was singular. A, B: (n, 3, 3) row-major, of all contacts.
  bool solve_once(const contact::ExplicitProblem& p, const Integers& active, const double* A,
                  const double* B, double* x);
  /// Factors the rows and columns of the contacts in `active` (ascending).
  bool factor(const contact::ExplicitProblem& p, const Integers& active, const double* A,
              const double* B);
  /// x <- solution, for x (3 active) in the order of `active`; not finite where the matrix was
  /// singular.
  void solve(double* x);

  /// Rows up to which the own dense factors are used, which do not allocate once they are that
  /// large.
  static constexpr int kDenseRows = 150;

 private:
  void assemble_dense(const contact::ExplicitProblem& p, const Integers& active, const double* A,
                      const double* B, int stride);

  int size_ = 0;
  bool large_ = false;
  Doubles matrix_;
  Integers pivot_;
  std::unique_ptr<LargeSystem> library_;
};

}  // namespace stickslip::solvers
