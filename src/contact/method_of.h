// The kernels' name for a single-contact method of the public API.
#pragma once
#include <stickslip/contact.h>

#include "contact/single.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

inline Method method_of(SingleContactMethod method) {
  switch (method) {
    case SingleContactMethod::kBisection:
      return Method::kBisection;
    case SingleContactMethod::kGoldenSection:
      return Method::kGoldenSection;
    case SingleContactMethod::kQuartic:
      return Method::kQuartic;
    default:
      return Method::kHalley;
  }
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
