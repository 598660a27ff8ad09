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

/// The n-th of those that this process had at its start, counted from 0; -1: it had fewer.
int nth_core(int n) {
  for (int core = 0; core < CPU_SETSIZE; ++core)
    if (CPU_ISSET(core, &at_start) && n-- == 0) return core;
  return -1;
}

}  // namespace

int pin(int core) {
  if (core == -2) core = nth_core(num_cores() > 1 ? 1 : 0);
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
  for (int k = 0; k < count; ++k)
    if (const int core = nth_core(first + k); core >= 0) CPU_SET(core, &set);
  sched_setaffinity(0, sizeof set, CPU_COUNT(&set) == count ? &set : &at_start);
}

OnCores::~OnCores() { sched_setaffinity(0, sizeof before_, &before_); }

}  // namespace stickslip::benchmarks
