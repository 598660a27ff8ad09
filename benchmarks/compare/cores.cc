#include "benchmarks/compare/cores.h"

#include <algorithm>
#include <cstdio>

namespace stickslip::benchmarks {
namespace {

cpu_set_t allowed() {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(0, sizeof set, &set);
  return set;
}

const cpu_set_t at_start = allowed();

}  // namespace

int pin(int core) {
  if (core == -2) core = CPU_ISSET(1, &at_start) ? 1 : 0;
  if (core < 0) return -1;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(core, &set);
  if (sched_setaffinity(0, sizeof set, &set) != 0) {
    std::printf("could not pin to core %d; running unpinned\n", core);
    return -1;
  }
  return core;
}

int num_cores() { return std::max(1, CPU_COUNT(&at_start)); }

OnCores::OnCores(int first, int count) : before_(allowed()) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (int core = 0, k = 0; core < CPU_SETSIZE; ++core)
    if (CPU_ISSET(core, &at_start)) {
      if (k >= first && k < first + count) CPU_SET(core, &set);
      ++k;
    }
  sched_setaffinity(0, sizeof set, CPU_COUNT(&set) == count ? &set : &at_start);
}

OnCores::~OnCores() { sched_setaffinity(0, sizeof before_, &before_); }

}  // namespace stickslip::benchmarks
