// Redundant contacts leave a choice of impulses with the same velocity; these take the least
// (docs/theory/solvers.md (C70)). Feet that press against each other through the ground, as sweeps
// may leave them, do so no longer, and copies of a contact share its load.
#pragma once
#include "contact/explicit_problem.h"

namespace stickslip::solvers {

/// The impulses of least norm among the contacts at rest (slower than `speed` [m/s]), normal and
/// tangential ones together: the load is spread evenly. Changes p.lambda only.
void spread_impulses(contact::ExplicitProblem& p, double speed);
/// The tangential impulses of least norm among the contacts that do not slide faster than `speed`,
/// normal impulses held. Changes p.lambda only.
void minimize_tangential_impulses(contact::ExplicitProblem& p, double speed);

}  // namespace stickslip::solvers
