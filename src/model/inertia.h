// Mass properties: moving them to another frame, adding them, and telling possible ones from
// impossible ones.
#pragma once
#include <stickslip/model.h>

#include <string>
#include <vector>

namespace stickslip {

/// A rigid body's principal moments obey, for moments a <= b <= c, 0 < a and c <= a + b (equality:
/// a flat plate).
///
/// Both tests are relative to the largest moment. The triangle inequality may be broken by 1 %:
/// descriptions give moments with three digits or more, so each may be wrong by 0.5 % of itself,
/// and for a plate the three errors add up to 0.005 (a + b + c) = 0.01 c. The smallest moment must
/// exceed 1e-9 c: the ratio of a rod 25,000 times longer than thick, and far above the rounding of
/// a merge, so nothing real is refused.
inline constexpr double kTriangleTolerance = 1e-2;
inline constexpr double kSmallestMomentRatio = 1e-9;

/// Principal moments of inertia in ascending order [kg m^2]; `inertia` is xx xy xz yy yz zz.
Vector3 principal_moments(const std::array<double, 6>& inertia);

/// Empty if a body can have this inertia, else what is wrong with it.
std::string inertia_defect(const std::array<double, 6>& inertia);

/// The same mass properties in frame A, given in frame B.
Inertial transform(const Pose& X_AB, const Inertial& inertial);

/// Mass properties of parts that are rigidly connected, all in one frame (parallel-axis theorem).
Inertial merge(const std::vector<Inertial>& parts);

}  // namespace stickslip
