#include "benchmarks/compare/cores.h"

#include <unistd.h>

#include <chrono>
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

cpu_set_t only(int core) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(core, &set);
  return set;
}

}  // namespace

int pin(int core) {
  if (core == -2) core = CPU_ISSET(1, &at_start) ? 1 : 0;
  if (core < 0) return -1;
  const cpu_set_t set = only(core);
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

TakeTurns::TakeTurns() : before_(allowed()) {
  // Long against what a move costs, short against a repetition.
  constexpr auto kTurn = std::chrono::milliseconds(3);
  mover_ = std::thread([this, kTurn, thread = gettid()] {
    sched_setaffinity(0, sizeof at_start, &at_start);
    std::unique_lock lock(mutex_);
    for (int core = 0; !over_; core = (core + 1) % CPU_SETSIZE) {
      if (!CPU_ISSET(core, &at_start)) continue;
      const cpu_set_t here = only(core);
      sched_setaffinity(thread, sizeof here, &here);
      end_.wait_for(lock, kTurn, [this] { return over_; });
    }
  });
}

TakeTurns::~TakeTurns() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  end_.notify_one();
  mover_.join();
  sched_setaffinity(0, sizeof before_, &before_);
}

}  // namespace stickslip::benchmarks
