#include "backend/cpu/thread_pool.h"

#include <stickslip/errors.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <system_error>
#ifdef __linux__
#include <sched.h>
#endif
#include <unistd.h>

namespace stickslip::backend {
namespace {

/// While it lives, this thread rounds to nearest and keeps small numbers, whatever a library has
/// set (PyTorch can flush them to zero): the bits of an environment may not depend on who steps it.
class StandardRounding {
 public:
#if defined(__x86_64__)
  StandardRounding() : before_(__builtin_ia32_stmxcsr()) { __builtin_ia32_ldmxcsr(0x1f80); }
  ~StandardRounding() { __builtin_ia32_ldmxcsr(before_); }

 private:
  unsigned before_;
#elif defined(__aarch64__)
  StandardRounding() {
    asm volatile("mrs %0, fpcr" : "=r"(before_));
    asm volatile("msr fpcr, %0" : : "r"(0ul));
  }
  ~StandardRounding() { asm volatile("msr fpcr, %0" : : "r"(before_)); }

 private:
  unsigned long before_;
#endif
};

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

ThreadPool::ThreadPool(int threads, bool pin)
    : cores_(usable_cores()), pin_(pin), process_(getpid()), shares_(threads) {
  workers_.reserve(threads - 1);
  try {
    for (int k = 1; k < threads; ++k) workers_.emplace_back([this, k] { serve(k); });
  } catch (const std::system_error&) {
    const std::size_t started = workers_.size() + 1;
    stop_workers();
    throw ModelError("Batch: the system lets this process have " + std::to_string(started) +
                     " of " + std::to_string(threads) + " threads; use a smaller num_threads");
  }
}

bool ThreadPool::forked() const { return process_ != getpid(); }

ThreadPool::~ThreadPool() {
  if (forked()) {
    // Handles of threads that are not here can be neither joined nor destroyed, and what they sleep
    // on, for who destroys it waits for them.
    new std::vector<std::thread>(std::move(workers_));
    static_cast<void>(beds_.release());
    return;
  }
  stop_workers();
}

void ThreadPool::stop_workers() {
  {
    const std::lock_guard lock(beds_->mutex);
    stop_ = true;
  }
  beds_->start.notify_all();
  for (std::thread& t : workers_) t.join();
  workers_.clear();
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

void ThreadPool::share_out(long items) {
  const long n = static_cast<long>(shares_.size());
  for (long k = 0; k < n; ++k) {
    // Rounded up: of few items the first are the calling thread's, which is awake.
    shares_[k].next.store((items * k + n - 1) / n, std::memory_order_relaxed);
    shares_[k].end = (items * (k + 1) + n - 1) / n;
  }
}

void ThreadPool::take_items(int thread) {
  const StandardRounding rounding;
  const int n = static_cast<int>(shares_.size());
  for (int k = 0; k < n; ++k) {
    Share& share = shares_[(thread + k) % n];
    if (share.next.load(std::memory_order_relaxed) >= share.end) continue;  // leaves the line alone
    for (long item = share.next.fetch_add(1, std::memory_order_relaxed); item < share.end;
         item = share.next.fetch_add(1, std::memory_order_relaxed))
      work_.call(work_.self, thread, item);
  }
}

/// False: there is none any more.
bool ThreadPool::wait_for_round(std::uint64_t seen) {
  const auto called = [&] { return stop_ || gate_.admits(seen); };
  if (!wait_awake(called)) {
    std::unique_lock lock(beds_->mutex);
    // Woken too late, it stays awake for the next.
    const std::uint64_t last = gate_.round();
    beds_->start.wait(lock, [&] { return called() || gate_.round() != last; });
  }
  return !stop_;
}

void ThreadPool::serve(int thread) {
  if (pin_) pin_to_core(thread);
  std::uint64_t seen = 0;
  while (wait_for_round(seen)) {
    if (!gate_.enter(seen)) continue;
    take_items(thread);
    if (gate_.leave()) {
      const std::lock_guard lock(beds_->mutex);
      beds_->finish.notify_one();
    }
  }
}

void ThreadPool::run(long items, Work work) {
  work_ = work;
  share_out(items);
  if (workers_.empty() || items < 2 || forked()) {
    take_items(0);
    return;
  }
  {
    const std::lock_guard lock(beds_->mutex);
    gate_.open();
  }
  beds_->start.notify_all();
  take_items(0);
  gate_.close();
  const auto done = [&] { return gate_.empty(); };
  if (!wait_awake(done)) {
    std::unique_lock lock(beds_->mutex);
    beds_->finish.wait(lock, done);
  }
}

}  // namespace stickslip::backend
