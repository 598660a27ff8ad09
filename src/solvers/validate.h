// Checks shared by the functions of the public contact API: what (C1) asks of G, c and mu. All
// throw ModelError.
#pragma once
#include <stickslip/contact.h>

namespace stickslip::solvers {

/// Length 3n and finite; `name` is what the error calls it.
void check_impulse(const char* name, const std::vector<double>& impulse, int n);
/// Golden section has no Coulomb form.
void check_single(SingleContactMethod method, FrictionLaw law, const char* where);

/// What SolveOptions and a world's StepSolverOptions have in common.
struct SolverSettings {
  SolveMethod method;
  FrictionLaw law;
  SingleContactMethod single_contact;
  double tolerance, relative_tolerance;
  int max_sweeps;
  double alpha, alpha_min, gamma;
};
template <class Options>
SolverSettings settings_of(const Options& o) {
  return {o.method,     o.law,   o.single_contact, o.tolerance, o.relative_tolerance,
          o.max_sweeps, o.alpha, o.alpha_min,      o.gamma};
}
/// The one place that knows their ranges; `where` is what the error calls the options.
void check_settings(const char* where, const SolverSettings& settings);

}  // namespace stickslip::solvers
