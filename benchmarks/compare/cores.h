// Which cores this process runs on.
#pragma once
#include <sched.h>

namespace stickslip::benchmarks {

/// Pins this thread, and threads it makes from now on, to a core; -2: the second of those that this
/// process may use, or the only one; -1: no pinning. Returns the core, or -1.
int pin(int core);

/// How many cores this process had at its start; at least 1.
int num_cores();

/// As long as one lives, this thread, and threads it makes, run on cores first, ..., first + count
/// - 1 of those (on all of them where there are not so many).
class OnCores {
 public:
  OnCores(int first, int count);
  ~OnCores();
  OnCores(const OnCores&) = delete;
  OnCores& operator=(const OnCores&) = delete;

 private:
  cpu_set_t before_;
};

}  // namespace stickslip::benchmarks
