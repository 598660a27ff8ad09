// Do all solvers solve the same problem? Order, sign, units and law, checked where the solution is
// unique.
#pragma once
#include "benchmarks/contact/method.h"

namespace stickslip::benchmarks {

/// Well-conditioned problems whose contacts stick, slide and open; prints how far the impulses of
/// each solver of others are from ours, relative to what stops max|c|, in its most exact setting.
/// False where that is above 1e-6.
bool solvers_agree(const Methods& methods);

}  // namespace stickslip::benchmarks
