#include "step/energy_safe.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template void step_energy_safe<double>(RobotLanes<double>&, const StepSettings&);

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
