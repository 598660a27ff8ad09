// What a run of a task showed: penetration, energy, explosions, distance, slip, solver effort.
#pragma once
#include <stickslip/world.h>

#include "scenes/anymal.h"

namespace stickslip::scenes {

/// Collects over any number of episodes of one ANYmal on ground at height 0. Call `begin` after
/// each reset and `observe` after each step, before the next reset.
class Statistics {
 public:
  /// `settle`: penetration counts only after so much of an episode [s]; `track_energy`: see
  /// `max_energy_growth`, costs a factorization per step.
  Statistics(const WorldOptions& options, double settle = 2.0, bool track_energy = false);

  void begin(const Robot& robot);
  void observe(const Robot& robot);

  long steps = 0, episodes = 0;
  double mean_penetration() const;     ///< of feet that push or overlap, after settling [m]
  double max_penetration = 0;          ///< after settling [m]
  double max_landing_penetration = 0;  ///< of a whole episode [m]
  double max_velocity = 0;             ///< largest |u_i| [m/s, rad/s]
  long exploded = 0;                   ///< episodes with a velocity above 1000 or not finite
  double max_energy_growth = 0;        ///< largest rise above the episode's running minimum [J]
  double distance = 0;                 ///< forward, of the base [m]
  double slip =
      0;  ///< sum over feet and steps of the horizontal speed of a loaded contact point [m]
  double contacts = 0, sweeps = 0, newton_steps = 0, substeps = 0;  ///< sums over steps
  double max_residual = 0;                                          ///< [m/s]
  long not_converged = 0;  ///< steps that reported a status

 private:
  WorldOptions options_;
  double settle_;
  bool track_energy_;
  double time_ = 0, x_ = 0, lowest_energy_ = 0;
  bool exploded_ = false;
  double penetration_sum_ = 0;
  long penetration_count_ = 0;
};

/// Kinetic plus potential energy at the configuration of the last step [J], by the rule under which
/// a free parabola keeps it exactly: the velocity of the semi-implicit step is half of gravity's
/// kick ahead of its configuration; the energy-safe step accounts for its own.
double node_energy(const Robot& robot, const WorldOptions& options);

}  // namespace stickslip::scenes
