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

}  // namespace stickslip::contact
