// The integrators, compiled once for the scalar of worlds; those of packs are compiled per
// instruction set (backend/cpu).
#pragma once
#include "step/robot_lanes.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template <class S>
void step_semi_implicit(RobotLanes<S>& robot, const StepSettings& settings);
template <class S>
void step_energy_safe(RobotLanes<S>& robot, const StepSettings& settings);

extern template void step_semi_implicit<double>(RobotLanes<double>&, const StepSettings&);
extern template void step_energy_safe<double>(RobotLanes<double>&, const StepSettings&);

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
