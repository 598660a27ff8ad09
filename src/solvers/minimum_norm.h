// Redundant contacts leave a choice of impulses with the same velocity; this takes the one with the
// least tangential part (docs/theory/solvers.md (C70)). Feet that press against each other through
// the ground, as sweeps may leave them, do so no longer.
#pragma once
#include "contact/explicit_problem.h"

namespace stickslip::solvers {

/// Changes p.lambda; p.v stays what it is, up to rounding, and is up to date afterwards. Normal
/// impulses and contacts that slide (faster than `speed` [m/s]) or are open keep theirs: only
/// sticking contacts have a choice.
void minimize_tangential_impulses(contact::ExplicitProblem& p, double speed);

}  // namespace stickslip::solvers
