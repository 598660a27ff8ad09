// The certificate of an impulse (docs/theory/solvers.md (C60)-(C64)); a pure function.
#pragma once
#include <stickslip/contact.h>

#include "contact/explicit_problem.h"

namespace stickslip::solvers {

/// p.v must be up to date.
Certificate certify(const contact::ExplicitProblem& p, bool max_dissipation);

}  // namespace stickslip::solvers
