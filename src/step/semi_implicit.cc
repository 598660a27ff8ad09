#include "step/semi_implicit.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template void step_semi_implicit<double>(RobotLanes<double>&, const StepSettings&);

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
