// A trotting gait for ANYmal B: legs in diagonal pairs, commanded forward speed along world x, flat
// ground.
//
// Stance legs share the wrench that holds the torso level and at its speed; swing legs follow a
// path to a foothold chosen from the speed error [Raibert 1986]. It knows no engine: state in,
// joint torques out.
#pragma once
#include <array>
#include <span>

#include "scenes/anymal.h"

namespace stickslip::scenes {

struct TrotOptions {
  double speed = 1.5;  ///< commanded forward speed, negative backwards; tried from -0.5 to 2 [m/s]
  double acceleration = 1.0;     ///< of the command from rest [m/s^2]
  double start = 0.3;            ///< the first step begins after standing this long [s]
  double period = 0.4;           ///< of one stride of one leg [s]
  double swing_fraction = 0.48;  ///< share of the stride a leg is in the air, below 0.5 [1]
  double clearance = 0.07;       ///< height of the foot in mid swing [m]
  double height = 0.48;          ///< of the base origin above the ground [m]
  double foothold_x = 0.31, foothold_y = 0.235;  ///< of the neutral foothold from the base [m]
  double foothold_gain = 0.06;                   ///< foothold shift per speed error [s]
  double friction = 0.6;     ///< cone that stance forces are kept in, below the real one [1]
  double torque_limit = 80;  ///< [N m]
  double ground = 0;         ///< height of the ground [m]
};

class TrotController {
 public:
  explicit TrotController(const TrotOptions& options = {});

  /// Forgets everything: the robot stands at rest at time 0 of `update`, and walks along its
  /// present y and world x.
  void reset(std::span<const double> q);

  /// Joint torques (12) [N m] for the state q (19), u (18) at `time` [s] since the reset. Call it
  /// once per step, 200 Hz or faster, with time rising. Allocates nothing.
  void update(double time, std::span<const double> q, std::span<const double> u,
              std::span<double> torque);

  /// Legs that bear load by plan: 1 stance, 0 swing.
  const std::array<bool, kNumLegs>& stance() const { return stance_; }
  const TrotOptions& options() const { return options_; }

 private:
  struct Swing {
    double progress = 0;   // 0..1 [1]
    Vector3 from{}, to{};  // sphere center at lift-off and at touch-down, world [m]
    bool landed = false;   // touched down before the planned end of this swing
  };
  void plan(double time, std::span<const double> q, const std::array<LegState, kNumLegs>& legs);
  std::array<Vector3, kNumLegs> stance_forces(double speed, std::span<const double> q,
                                              std::span<const double> u,
                                              const std::array<LegState, kNumLegs>& legs) const;
  Vector3 foothold(int leg, double speed, std::span<const double> q,
                   std::span<const double> u) const;
  Vector3 swing_torque(int leg, std::span<const double> q, const LegState& state) const;
  double speed_command(double time, double speed);
  double lateral_command(std::span<const double> q) const;

  TrotOptions options_;
  std::array<bool, kNumLegs> stance_{};
  std::array<Swing, kNumLegs> swing_{};
  double lane_ = 0;        // y of the line to follow [m]
  double speed_bias_ = 0;  // [m/s]
  double time_ = 0;        // of the last update [s]
};

}  // namespace stickslip::scenes
