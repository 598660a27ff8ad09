// The contact solvers that a step calls outside its kernels: the paper's methods where a world asks
// for one, and the first stages of the chain of `stickslip::solve` where the factored solver ends
// above its tolerance. Memory is taken once.
#pragma once
#include <stickslip/world.h>

#include "step/step_tables.h"
#include "world/aligned_block.h"

namespace stickslip::world {

class SolverOnHost {
 public:
  /// For problems of up to `max_points` contacts.
  SolverOnHost(int max_points, const StepSolverOptions& options);

  /// What the step calls; valid as long as this object stays where it is.
  step::HostSolver view();

 private:
  static step::HostSolver::Effort run_chain(void* self, step::DenseProblem& problem,
                                            double tolerance);
  static step::HostSolver::Effort run_method(void* self, step::DenseProblem& problem,
                                             double tolerance);

  StepSolverOptions options_;
  int max_contacts_;
  AlignedBlock memory_;
};

/// Seconds of a steady clock.
double clock_seconds();

/// What a step reads of a world's options; ground and host solver are the owner's to fill in.
step::StepSettings step_settings(const WorldOptions& options);

}  // namespace stickslip::world
