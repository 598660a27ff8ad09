// Primal-dual interior-point method on the second-order cones of friction (docs/theory/solvers.md
// (C40) to (C46)), [Acary 2024]. Solves what sweeps and Newton steps from an active set lose: large
// mass ratios, many coupled contacts.
//
// Scaled per contact, x = D^-1 lambda and y = D (v + mu |v_T| z) lie in the same self-dual cone
// {x_z >= |x_T|}; a solution has x o y = 0. Steps of Nesterov and Todd with Mehrotra's corrector
// follow x o y = tau e to tau = 0. De Saxce's shift mu |v_T| is what makes Coulomb's law more than
// a convex problem; how it enters a step is the one choice (`ShiftRule`).
#pragma once
#include "solvers/best_impulse.h"
#include "solvers/block_system.h"
#include "solvers/second_order_cone.h"

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
  /// A contact that can push, in scaled variables; x, y, z each.
  struct Cone {
    double D[3];  // lambda = D x
    double x[3], y[3];
    double F[3];   // D v + shift - y: what the velocity lacks
    double shift;  // mu |v_T|, scaled
    Scaling s;
    double lambda[3];           // S y = S^-1 x
    double complementarity[3];  // right-hand side of S^-1 dx + S dy = lambda \ complementarity
    double dx[3], dy[3];
  };

  void start();
  void evaluate(ShiftRule shift, bool first);
  bool factor(ShiftRule shift);
  double predict();
  void correct(double center);
  void step_direction();
  double longest_step() const;
  bool advance();

  contact::ExplicitProblem& p_;
  BlockSystem system_;
  Integers active_;
  std::pmr::vector<Cone> cones_;  // of the contacts in `active_`
  Doubles A_, B_, right_;         // of the linear system
  Doubles least_;                 // the impulse of least residual of this run
  bool exact_ = false;
  int iterations_ = 0;
};

}  // namespace stickslip::solvers
