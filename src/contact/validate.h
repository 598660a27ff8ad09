// Checks shared by the functions of the public contact API. All throw ModelError.
#pragma once
#include <stickslip/contact.h>

#include "contact/dense_factor.h"

namespace stickslip::contact {

/// `ContactProblem::validate`, and the factor G = Y Y^T that it needs for it.
DenseFactor validated_factor(const ContactProblem& problem);
/// Length 3n and finite; `name` is what the error calls it.
void check_impulse(const char* name, const std::vector<double>& impulse, int n);
/// Golden section has no Coulomb form.
void check_single(SingleContactMethod method, FrictionLaw law, const char* where);

/// What SolveOptions and a world's StepSolverOptions have in common.
struct SolverSettings {
  SolveMethod method;
  FrictionLaw law;
  SingleContactMethod single_contact;
  double tolerance;
  int max_sweeps;
  double alpha, alpha_min, gamma;
};
template <class Options>
SolverSettings settings_of(const Options& o) {
  return {o.method,     o.law,   o.single_contact, o.tolerance,
          o.max_sweeps, o.alpha, o.alpha_min,      o.gamma};
}
/// The one place that knows their ranges; `where` is what the error calls the options.
void check_settings(const char* where, const SolverSettings& settings);

}  // namespace stickslip::contact
