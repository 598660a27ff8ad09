// Which packs were built, and which of them this machine can run.
#include "backend/cpu/instruction_sets.h"

#include <cstring>

namespace stickslip::backend {

#define STICKSLIP_PACK(name) extern const PackKernels name;
STICKSLIP_PACKS
#undef STICKSLIP_PACK

namespace {

// Widest registers first.
const PackKernels* const kBuilt[] = {
#define STICKSLIP_PACK(name) &name,
    STICKSLIP_PACKS
#undef STICKSLIP_PACK
};

bool machine_has(const char* instruction_set) {
#if defined(__x86_64__)
  if (std::strcmp(instruction_set, "avx512") == 0)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  (void)instruction_set;
  return true;  // NEON is part of every 64-bit ARM
#endif
}

}  // namespace

const PackKernels* find_kernels(const std::string& instruction_set, bool single, int width) {
  for (const PackKernels* k : kBuilt) {
    if (k->single != single || !machine_has(k->instruction_set)) continue;
    if (!instruction_set.empty() && instruction_set != k->instruction_set) continue;
    if (width == 0 || width == k->width) return k;
  }
  return nullptr;
}

std::string instruction_sets() {
  std::string text;
  for (const PackKernels* k : kBuilt) {
    if (!machine_has(k->instruction_set) || text.find(k->instruction_set) != std::string::npos)
      continue;
    text += (text.empty() ? "" : ", ") + std::string(k->instruction_set);
  }
  return text;
}

}  // namespace stickslip::backend
