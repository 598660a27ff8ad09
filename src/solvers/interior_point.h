// Primal-dual interior-point method on the second-order cones of friction (docs/theory/solvers.md
// (C40)- (C46)), [Acary 2024]. Solves what sweeps and Newton steps from an active set lose: large
// mass ratios, many coupled contacts.
//
// Scaled per contact, x = E^-1 D^-1 lambda and y = D E (v + mu |v_T| z) lie in the same self-dual
// cone {x_z >= |x_T|}; a solution has x o y = 0. Steps of Nesterov and Todd with Mehrotra's
// corrector follow x o y = tau e to tau = 0. De Saxce's shift mu |v_T| is what makes Coulomb's law
// more than a convex problem; how it enters a step is the one choice (`ShiftRule`).
#pragma once
#include "solvers/alart_curnier.h"
#include "solvers/best_impulse.h"
#include "solvers/block_system.h"

namespace stickslip::solvers {

class InteriorPoint {
 public:
  explicit InteriorPoint(contact::ExplicitProblem& p,
                         Memory memory = std::pmr::get_default_resource());

  /// Starts from its own interior point, offers every iterate. True once solved; at most
  /// `max_iterations`. Leaves p.lambda at the best of its iterates, p.v up to date.
  bool run(BestImpulse& best, ShiftRule shift, int max_iterations);
  int iterations() const { return iterations_; }

 private:
  void start();
  void evaluate(ShiftRule shift, bool first);
  bool factor(ShiftRule shift);
  void step_direction(const Doubles& complementarity);
  double longest_step() const;

  contact::ExplicitProblem& p_;
  BlockSystem system_;
  Integers active_;
  Doubles A_, B_, right_;
  // Per active contact, x, y, z.
  Doubles x_, y_, dx_, dy_, F_, lambda_, complementarity_, scaling_;
  Doubles shift_;  // mu |v_T|, scaled, per active contact
  Doubles least_;  // the impulse of least residual of this run
  Doubles D_;      // (contacts, 2): tangential and normal factor of lambda = D x
  bool exact_ = false;
  int iterations_ = 0;
};

}  // namespace stickslip::solvers
