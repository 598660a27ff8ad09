// Which cores this process runs on.
#pragma once
#include <sched.h>

#include <condition_variable>
#include <mutex>
#include <thread>

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

/// As long as one lives, this thread moves on to the next of those cores every few milliseconds: it
/// has their mean speed, as the threads have that it is compared with. On a shared machine the
/// cores differ, and not always in the same way.
class TakeTurns {
 public:
  TakeTurns();
  ~TakeTurns();
  TakeTurns(const TakeTurns&) = delete;
  TakeTurns& operator=(const TakeTurns&) = delete;

 private:
  cpu_set_t before_;
  std::mutex mutex_;
  std::condition_variable end_;
  bool over_ = false;
  std::thread mover_;
};

}  // namespace stickslip::benchmarks
