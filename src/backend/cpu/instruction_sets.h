// Picks the pack that suits the machine.
#pragma once
#include <string>

#include "backend/cpu/pack_kernels.h"

namespace stickslip::backend {

/// The kernels of this machine that fit, widest registers first; null: none.
/// An empty `instruction_set` and a `width` of 0 match any.
const PackKernels* find_kernels(const std::string& instruction_set, bool single, int width);
/// Instruction sets that were built and that this machine has, as "avx512, avx2".
std::string instruction_sets();

}  // namespace stickslip::backend
