// `solve` and `certify` for problems that have been validated already (a front that keeps its
// problem checks it once).
#pragma once
#include <stickslip/contact.h>

#include <vector>

namespace stickslip::solvers {

SolveResult solve_checked(const ContactProblem& problem, const SolveOptions& options,
                          const std::vector<double>& warm_start);
Certificate certify_checked(const ContactProblem& problem, const std::vector<double>& impulse,
                            FrictionLaw law);

}  // namespace stickslip::solvers
