// Compiled once per instruction set, number format and width:
//   STICKSLIP_KERNELS        inline namespace of the kernels, named after the instruction set
//   STICKSLIP_PACK_NUMBER    float or double
//   STICKSLIP_PACK_WIDTH     environments of a pack
//   STICKSLIP_PACK_TABLE     name of the table of functions
// No function of the standard library may be used here: the linker would keep one copy of it for
// all instruction sets (tests/backend checks the object files).
#include "backend/cpu/pack_kernels.h"

#include "backend/cpu/pack_lanes.h"
#include "step/energy_safe.h"
#include "step/semi_implicit.h"

namespace stickslip::backend::inline STICKSLIP_KERNELS {

#if STICKSLIP_PACK_WIDTH == 1
using Lanes = STICKSLIP_PACK_NUMBER;
#else
using Lanes = Pack<STICKSLIP_PACK_NUMBER, STICKSLIP_PACK_WIDTH>;
#endif

static long workspace_bytes(const PackScene& scene) {
  contact::Arena count(nullptr);
  PackLanes<Lanes> lanes;
  lanes.lay_out(count, scene);
  return count.used() + long(sizeof(PackLanes<Lanes>)) + 64;
}

static void prepare(void* workspace, const PackScene& scene) {
  auto* lanes = static_cast<PackLanes<Lanes>*>(workspace);
  contact::Arena arena(static_cast<char*>(workspace) +
                       contact::round_up(int(sizeof(PackLanes<Lanes>)), 64));
  lanes->lay_out(arena, scene);
}

static StatusBits step_pack(void* workspace, const EnvArrays& arrays, const PackInertias& inertias,
                            const step::StepSettings& settings, long first, long num_envs,
                            int steps) {
  auto& lanes = *static_cast<PackLanes<Lanes>*>(workspace);
  lanes.load(arrays, first, num_envs);
  lanes.use_inertias(inertias);
  for (int k = 0; k < steps; ++k) {
    lanes.keep_contacts(k + 1 == steps);
    if (settings.energy_safe)
      step::step_energy_safe(lanes.robot(), settings);
    else
      step::step_semi_implicit(lanes.robot(), settings);
    lanes.count_step();
  }
  return lanes.store(arrays, settings, first, num_envs);
}

}  // namespace stickslip::backend::inline STICKSLIP_KERNELS

namespace stickslip::backend {

#define STICKSLIP_TEXT_OF(x) #x
#define STICKSLIP_TEXT(x) STICKSLIP_TEXT_OF(x)

extern const PackKernels STICKSLIP_PACK_TABLE;
const PackKernels STICKSLIP_PACK_TABLE = {STICKSLIP_TEXT(STICKSLIP_KERNELS),
                                          sizeof(STICKSLIP_PACK_NUMBER) == 4,
                                          STICKSLIP_PACK_WIDTH,
                                          dynamics::BundleScalar<Lanes>::kLanes,
                                          workspace_bytes,
                                          prepare,
                                          step_pack};

}  // namespace stickslip::backend
