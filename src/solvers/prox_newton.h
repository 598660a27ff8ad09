// Proximal point method with damped semismooth Newton steps on the map of Alart and Curnier, on an
// explicit problem (docs/theory/solvers.md, section 4, (C35)-(C39)). Coulomb's law.
//
// lambda^(k+1) solves the problem with v + alpha scale (lambda - lambda^k) in place of v: regular
// however redundant the contacts are. alpha shrinks after each solved subproblem, also where the
// residual has not halved (a rule driven by the residual loses stacks), and grows after a failure.
#pragma once
#include "solvers/alart_curnier.h"
#include "solvers/best_impulse.h"
#include "solvers/block_system.h"

namespace stickslip::solvers {

class ProxNewton {
 public:
  explicit ProxNewton(contact::ExplicitProblem& p,
                      Memory memory = std::pmr::get_default_resource());

  /// Starts at p.lambda with proximal weight alpha; offers what it finds. True once solved; at most
  /// `max_steps` Newton steps. Leaves p.lambda anywhere.
  bool run(BestImpulse& best, double alpha, int max_steps);
  /// One undamped step from p.lambda with weight alpha; p.v must be up to date, and is not
  /// afterwards. False, and nothing changed, where the step is not finite.
  bool step(double alpha);
  int steps() const { return steps_; }

 private:
  bool subproblem(BestImpulse& best, double alpha, double start_residual, double tolerance,
                  int max_steps);
  void shift_velocity(double alpha);
  double merit();
  bool direction(double alpha);

  contact::ExplicitProblem& p_;
  BlockSystem system_;
  // One block for all: small problems would spend more time on allocations than on a step.
  Doubles memory_;
  double *center_, *origin_, *direction_, *right_, *u_, *F_, *A_, *B_;  // (3n) and, A and B, (9n)
  Integers active_;
  int steps_ = 0;
};

}  // namespace stickslip::solvers
