// Threads that share the packs of a batch. Which thread steps which pack shows in no bit.
#pragma once
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "backend/cpu/round_gate.h"

namespace stickslip::backend {

/// Cores (hardware threads) that the calling thread may run on.
std::vector<int> usable_cores();

class ThreadPool {
 public:
  /// `threads` >= 1 work, the calling one among them. `pin`: thread k >= 1 is bound to core k,
  /// counted from 0, of usable_cores() now (k modulo their number); it stays free where that core
  /// is taken from the process meanwhile.
  ThreadPool(int threads, bool pin);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int size() const { return static_cast<int>(workers_.size()) + 1; }

  struct Work {
    void (*call)(void* self, int thread, long item) noexcept;
    void* self;
  };
  /// Calls work.call(work.self, thread, item) for each item 0 .. items - 1, each once, and returns
  /// when all are done. One round at a time, and none from within a call. In a forked process the
  /// calling thread does them all.
  void run(long items, Work work);

 private:
  void serve(int thread);
  bool wait_for_round(std::uint64_t seen);
  void stop_workers();
  /// An equal part of the items belongs to each thread, the same in every run: what it works on
  /// stays in its core's cache. Who is through with his own takes those of others.
  struct alignas(64) Share {
    std::atomic<long> next{0};
    long end = 0;
  };
  void share_out(long items);
  void take_items(int thread);
  void pin_to_core(int thread) const;
  bool forked() const;

  std::vector<std::thread> workers_;
  std::vector<int> cores_;
  bool pin_;
  long process_;
  /// Where who has waited awake for too long sleeps.
  struct Beds {
    std::mutex mutex;
    std::condition_variable start, finish;
  };
  std::unique_ptr<Beds> beds_ = std::make_unique<Beds>();
  RoundGate gate_;
  std::atomic<bool> stop_{false};
  std::vector<Share> shares_;
  Work work_ = {};
};

}  // namespace stickslip::backend
