// Numbers that every scene and every generated problem shares.
#pragma once

namespace stickslip::scenes {

inline constexpr double kGravity = 9.81;  ///< [m/s^2]
inline constexpr double kProblemStep =
    1e-3;  ///< free motion before the contacts of a problem act [s]

}  // namespace stickslip::scenes
