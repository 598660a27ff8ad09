// Which cores this process runs on.
#pragma once
#include <sched.h>

namespace stickslip::benchmarks {

/// Pins this thread, and threads it makes from now on, to a core; -2: core 1 where there is one,
/// else 0; -1: no pinning. Returns the core, or -1.
int pin(int core);

/// As long as one lives, this thread may use all cores that it had before `pin`.
class UseAllCores {
 public:
  UseAllCores();
  ~UseAllCores();
  UseAllCores(const UseAllCores&) = delete;
  UseAllCores& operator=(const UseAllCores&) = delete;

 private:
  cpu_set_t before_;
};

}  // namespace stickslip::benchmarks
