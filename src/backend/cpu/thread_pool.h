// Threads that share the packs of a batch. Which thread steps which pack shows in no bit.
#pragma once
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace stickslip::backend {

/// Cores that this process may use.
std::vector<int> usable_cores();

class ThreadPool {
 public:
  /// `threads` >= 1 work, the calling one among them. `pin`: each but the calling one is bound to a
  /// core of its own, of those that the process may use now.
  ThreadPool(int threads, bool pin);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int size() const { return static_cast<int>(workers_.size()) + 1; }

  /// Calls call(self, thread, item) for each item 0 .. items - 1, each once, and returns when all
  /// are done. It must not throw.
  struct Work {
    void (*call)(void* self, int thread, long item);
    void* self;
  };
  void run(long items, Work work);

 private:
  void serve(int thread);
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
  std::mutex mutex_;
  std::condition_variable start_, finish_;
  std::atomic<unsigned long> round_{0};
  std::atomic<int> busy_{0};
  std::atomic<bool> stop_{false};
  std::vector<Share> shares_;
  Work work_ = {};
};

}  // namespace stickslip::backend
