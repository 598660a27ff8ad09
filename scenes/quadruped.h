// A quadruped like ANYmal (33 kg, 18 dofs) in random postures, and contact problems at its feet and
// torso. Small and without a Model, so that solvers are tested without the simulator.
//
// u: velocity of the torso's center [m/s], its angular velocity [rad/s], both in world axes, then
// three joint rates of each leg [rad/s].
#pragma once
#include <stickslip/contact.h>

#include <array>

#include "scenes/constants.h"
#include "scenes/random.h"
#include "scenes/vector.h"

namespace stickslip::scenes {

inline constexpr int kQuadrupedDofs = 18;

using QuadrupedRow = std::array<double, kQuadrupedDofs>;
/// Jacobian of a point: its velocity is `rows . u` [m/s].
using PointRows = std::array<QuadrupedRow, 3>;

/// A floating box with four legs of three joints (roll, pitch, pitch).
struct Quadruped {
  std::array<QuadrupedRow, kQuadrupedDofs> mass_matrix{};  ///< [kg, kg m, kg m^2]
  std::array<PointRows, 4> feet;
  std::array<PointRows, 8> corners;               ///< of the torso, the lower four first
  std::array<std::array<PointRows, 4>, 4> soles;  ///< four points of a flat sole at each foot
  /// A random posture: the torso turned by up to `tilt` [rad] about x and y.
  explicit Quadruped(Random& rng, double tilt = 0.3);

 private:
  struct Leg;
  void add_leg(int leg, const Matrix3& base, const Vector3& joint_angles);
  void add_link(double mass, double length, const Vector3& center, const Matrix3& axes,
                const Leg& leg, int joints);
};

/// M = L^T L, with L lower triangular: no fill-in between legs.
class QuadrupedFactor {
 public:
  explicit QuadrupedFactor(const Quadruped& robot);
  QuadrupedRow project(QuadrupedRow row) const;     ///< row L^-1
  QuadrupedRow times(const QuadrupedRow& u) const;  ///< L u

 private:
  std::array<QuadrupedRow, kQuadrupedDofs> l_;
};

enum QuadrupedScene {
  kStand,       ///< four feet at rest, random joint torques
  kTrot,        ///< two to four feet while trotting at 1.5 m/s, random joint torques
  kImpact,      ///< four feet that land with 3 m/s and random joint velocities
  kRestEight,   ///< four feet and four torso corners at rest, random joint torques
  kDropEight,   ///< the same eight points, landing
  kDropTwelve,  ///< four feet and all torso corners, landing
  kSoles,       ///< two flat feet of four points each, landing
  kNumScenes
};
const char* scene_name(int scene);

/// Contacts of one quadruped in the coordinates x = L u of its factor: v = c0 + Y Y^T lambda with
/// Y = J L^-1 and c0 = J u_free, so that G = J M^-1 J^T = Y Y^T.
struct RobotProblem {
  int n = 0;            ///< contacts
  int m = 6;            ///< shared coordinates: the base's, for soles also those of two legs
  double y[12][3][18];  ///< [kg^-1/2]
  double c0[12][3];     ///< [m/s]
  double mu = 0.8;      ///< of every contact
  int leg[12];          ///< -1: torso
  bool soles = false;
};
RobotProblem random_robot_problem(int scene, Random& rng);

/// The same with G multiplied out.
ContactProblem dense(const RobotProblem& problem);

}  // namespace stickslip::scenes
