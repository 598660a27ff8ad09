// The kernels' name for a single-contact method of the public API.
#pragma once
#include <stickslip/contact.h>

#include "contact/single.h"

namespace stickslip::solvers {

inline contact::Method method_of(SingleContactMethod method) {
  switch (method) {
    case SingleContactMethod::kBisection:
      return contact::Method::kBisection;
    case SingleContactMethod::kGoldenSection:
      return contact::Method::kGoldenSection;
    case SingleContactMethod::kQuartic:
      return contact::Method::kQuartic;
    default:
      return contact::Method::kHalley;
  }
}

}  // namespace stickslip::solvers
