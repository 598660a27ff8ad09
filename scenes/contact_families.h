// Random single-contact problems: four families, each a mix of opening, sticking and sliding
// contacts. Used by tests and benchmarks.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "scenes/random.h"

namespace stickslip::scenes {

struct SingleContact {
  std::array<double, 9> G;  // row-major [1/kg]
  std::array<double, 3> c;  // [m/s]
  double mu;
};

enum class ContactFamily {
  kNearDiagonal,   ///< like a foot straight below the body
  kWishart,        ///< G = A A^T / 6 with A 3x6 normal
  kRobotFoot,      ///< foot of a quadruped in a random posture
  kIllConditioned  ///< condition numbers up to 1e6, friction up to 3: a sixth of the conics is
                   ///< unbounded
};
inline constexpr ContactFamily kContactFamilies[] = {
    ContactFamily::kNearDiagonal, ContactFamily::kWishart, ContactFamily::kRobotFoot,
    ContactFamily::kIllConditioned};
const char* family_name(ContactFamily family);

enum class ContactMix { kAll, kSlipOnly };

/// `count` problems of a family: a third opens, a third sticks, a third slides (kSlipOnly: all
/// slide). The impulse of a closing contact has norm 1 N s.
std::vector<SingleContact> random_contacts(ContactFamily family, int count, std::uint64_t seed,
                                           ContactMix mix = ContactMix::kAll);

}  // namespace stickslip::scenes
