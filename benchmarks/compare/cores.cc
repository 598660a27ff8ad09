#include "benchmarks/compare/cores.h"

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

UseAllCores::UseAllCores() : before_(allowed()) {
  sched_setaffinity(0, sizeof at_start, &at_start);
}

UseAllCores::~UseAllCores() { sched_setaffinity(0, sizeof before_, &before_); }

}  // namespace stickslip::benchmarks
