#include "backend/cpu/thread_pool.h"

#include <algorithm>
#include <chrono>
#ifdef __linux__
#include <sched.h>
#endif

namespace stickslip::backend {
namespace {

// A worker that has just worked waits this long awake: steps follow each other within it, and
// waking costs as much as stepping a thousand robots.
constexpr auto kAwake = std::chrono::microseconds(50);

/// True as soon as `ready` is; false when it was not for kAwake.
template <class F>
bool wait_awake(F&& ready) {
  const auto end = std::chrono::steady_clock::now() + kAwake;
  do {
    for (int k = 0; k < 64; ++k)
      if (ready()) return true;
    std::this_thread::yield();
  } while (std::chrono::steady_clock::now() < end);
  return false;
}

}  // namespace

std::vector<int> usable_cores() {
  std::vector<int> cores;
#ifdef __linux__
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0)
    for (int k = 0; k < CPU_SETSIZE; ++k)
      if (CPU_ISSET(k, &set)) cores.push_back(k);
#endif
  if (cores.empty())
    for (int k = 0; k < std::max(1, static_cast<int>(std::thread::hardware_concurrency())); ++k)
      cores.push_back(k);
  return cores;
}

ThreadPool::ThreadPool(int threads, bool pin) : cores_(usable_cores()), pin_(pin) {
  for (int k = 1; k < threads; ++k) workers_.emplace_back([this, k] { serve(k); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    ++round_;
  }
  start_.notify_all();
  for (std::thread& t : workers_) t.join();
}

void ThreadPool::pin_to_core(int thread) const {
#ifdef __linux__
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cores_[thread % cores_.size()], &set);
  sched_setaffinity(0, sizeof set, &set);
#else
  (void)thread;
#endif
}

void ThreadPool::take_items(int thread) {
  for (long item = next_.fetch_add(1, std::memory_order_relaxed); item < items_;
       item = next_.fetch_add(1, std::memory_order_relaxed))
    work_.call(work_.self, thread, item);
}

void ThreadPool::serve(int thread) {
  if (pin_) pin_to_core(thread);
  unsigned long seen = 0;
  for (;;) {
    const auto called = [&] { return round_.load(std::memory_order_acquire) != seen; };
    if (!wait_awake(called)) {
      std::unique_lock lock(mutex_);
      start_.wait(lock, called);
    }
    ++seen;
    if (stop_) return;
    take_items(thread);
    if (busy_.fetch_sub(1, std::memory_order_acq_rel) == 1) {
      const std::lock_guard lock(mutex_);
      finish_.notify_one();
    }
  }
}

void ThreadPool::run(long items, Work work) {
  items_ = items;
  work_ = work;
  next_.store(0, std::memory_order_relaxed);
  if (workers_.empty() || items < 2) {
    take_items(0);
    return;
  }
  busy_.store(static_cast<int>(workers_.size()), std::memory_order_relaxed);
  {
    const std::lock_guard lock(mutex_);
    round_.fetch_add(1, std::memory_order_release);
  }
  start_.notify_all();
  take_items(0);
  const auto done = [&] { return busy_.load(std::memory_order_acquire) == 0; };
  if (!wait_awake(done)) {
    std::unique_lock lock(mutex_);
    finish_.wait(lock, done);
  }
}

}  // namespace stickslip::backend
