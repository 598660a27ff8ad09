// Threads that share items: each is done once, whatever the numbers of both, round after round.
#include <chrono>
#include <memory>
#include <set>
#include <vector>
#ifdef __linux__
#include <sched.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#endif

#include "backend/cpu/thread_pool.h"
#include "check.h"

using stickslip::backend::ThreadPool;
using stickslip::backend::usable_cores;

namespace {

constexpr int kThreads[] = {1, 2, 3, 5, 8};

/// How often each item was done, and by threads of which numbers.
struct Tally {
  explicit Tally(long items) : done(items) {}
  std::vector<std::atomic<int>> done;
  std::atomic<int> lowest{1 << 30}, highest{-1};

  static void call(void* self, int thread, long item) noexcept {
    auto& t = *static_cast<Tally*>(self);
    ++t.done[item];
    for (int seen = t.lowest; thread < seen && !t.lowest.compare_exchange_weak(seen, thread);) {
    }
    for (int seen = t.highest; thread > seen && !t.highest.compare_exchange_weak(seen, thread);) {
    }
  }
  ThreadPool::Work work() { return {call, this}; }
  bool each(int times) const {
    for (const auto& n : done)
      if (n != times) return false;
    return true;
  }
};

}  // namespace

TEST(EachItemIsDoneOnceByAThreadOfThePool) {
  for (const bool pin : {false, true})
    for (const int threads : kThreads) {
      ThreadPool pool(threads, pin);
      CHECK(pool.size() == threads);
      for (const long items : {0l, 1l, 2l, 7l, 1000l}) {
        Tally tally(items);
        pool.run(items, tally.work());
        CHECK(tally.each(1));
        CHECK(items == 0 || (tally.lowest >= 0 && tally.highest < threads));
      }
    }
}

TEST(EachOfTwoThreadsBeginsWithItsOwnShareInEveryRound) {
  struct First {
    std::atomic<long> of[2];
    static void call(void* self, int thread, long item) noexcept {
      long none = -1;
      static_cast<First*>(self)->of[thread].compare_exchange_strong(none, item);
      const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(20);
      while (std::chrono::steady_clock::now() < end) {  // so that the other wakes up in time
      }
    }
  } first;
  ThreadPool pool(2, false);
  int both = 0;
  bool own = true;
  for (int round = 0; round < 200; ++round) {
    first.of[0] = first.of[1] = -1;
    pool.run(50, {First::call, &first});
    own = own && first.of[0] < 25 && (first.of[1] == -1 || first.of[1] >= 25);
    both += first.of[0] >= 0 && first.of[1] >= 0;
  }
  CHECK(own);
  CHECK(both > 0);
}

TEST(RoundsFollowEachOther) {
  for (const int threads : kThreads) {
    ThreadPool pool(threads, false);
    Tally tally(13);
    int rounds = 0;
    bool all_done = true;
    for (; rounds < 500; ++rounds) {
      pool.run(13, tally.work());
      all_done = all_done && tally.each(rounds + 1);  // also: run returns when all is done
    }
    CHECK(all_done);
  }
}

TEST(RoundsOfOneItemAndOfNoneComeBetweenOthers) {
  ThreadPool pool(4, false);
  Tally many(9), one(1), none(0);
  for (int k = 0; k < 200; ++k) {
    pool.run(9, many.work());
    pool.run(1, one.work());
    pool.run(0, none.work());
  }
  CHECK(many.each(200) && one.each(200));
}

TEST(ThreadsThatFellAsleepWakeUp) {
  ThreadPool pool(3, false);
  Tally tally(50);
  for (int k = 0; k < 20; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    pool.run(50, tally.work());
    CHECK(tally.each(k + 1));
  }
}

TEST(TwoItemsAreDoneAtTheSameTimeByTwoThreads) {
  struct Meeting {
    std::atomic<int> here{0}, met{0};
    static void call(void* self, int, long) noexcept {
      auto& m = *static_cast<Meeting*>(self);
      ++m.here;
      const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
      while (m.here < 2 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
      m.met += m.here == 2;
    }
  } meeting;
  ThreadPool pool(2, false);
  pool.run(2, {Meeting::call, &meeting});
  CHECK(meeting.met == 2);
}

TEST(ItemsOfAThreadThatIsHeldUpAreTakenByOthers) {
  struct HeldUp {
    std::atomic<int> others{0};
    std::atomic<bool> all_came{false};
    static void call(void* self, int, long item) noexcept {
      auto& h = *static_cast<HeldUp*>(self);
      if (item > 0) {
        ++h.others;
        return;
      }
      const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
      while (h.others < 11 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
      h.all_came = h.others == 11;
    }
  };
  for (const int threads : {2, 3, 4}) {
    HeldUp held_up;
    ThreadPool pool(threads, false);
    pool.run(12, {HeldUp::call, &held_up});
    CHECK(held_up.all_came);
  }
}

TEST(RunReturnsAfterTheSlowestItem) {
  struct Slow {
    std::atomic<int> done{0};
    static void call(void* self, int, long item) noexcept {
      if (item == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      ++static_cast<Slow*>(self)->done;
    }
  } slow;
  ThreadPool pool(3, false);
  pool.run(4, {Slow::call, &slow});
  CHECK(slow.done == 4);
}

TEST(PoolsComeAndGoWithOrWithoutWork) {
  for (int k = 0; k < 50; ++k) {
    ThreadPool idle(3, false), busy(2, false);
    Tally tally(3);
    busy.run(3, tally.work());
    CHECK(tally.each(1));
  }
}

#ifdef __linux__
namespace {

/// The cores that each thread may run on, as it sees them itself.
struct Cores {
  explicit Cores(int threads) : of(threads), seen(threads) {}
  std::vector<cpu_set_t> of;
  std::vector<std::atomic<bool>> seen;
  static void call(void* self, int thread, long) noexcept {
    auto& c = *static_cast<Cores*>(self);
    sched_getaffinity(0, sizeof c.of[thread], &c.of[thread]);
    c.seen[thread] = true;
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1);
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
  }
  bool all_seen() const {
    for (const auto& yes : seen)
      if (!yes) return false;
    return true;
  }
};

}  // namespace

TEST(EachPinnedThreadHasOneCoreAndTheCallingOneIsLeftFree) {
  const std::vector<int> usable = usable_cores();
  cpu_set_t before;
  sched_getaffinity(0, sizeof before, &before);
  CHECK(static_cast<int>(usable.size()) == CPU_COUNT(&before));
  const int threads = static_cast<int>(usable.size()) + 1;  // one more: the cores begin again
  ThreadPool pool(threads, true);
  Cores cores(threads);
  for (int k = 0; k < 2000 && !cores.all_seen(); ++k) pool.run(2 * threads, {Cores::call, &cores});
  CHECK(cores.all_seen());
  CHECK(CPU_EQUAL(&before, &cores.of[0]));
  std::set<int> taken;
  for (int k = 1; k < threads; ++k) {
    const int core = usable[k % usable.size()];
    CHECK(CPU_COUNT(&cores.of[k]) == 1 && CPU_ISSET(core, &cores.of[k]));
    taken.insert(core);
  }
  CHECK(taken.size() == usable.size());
}

namespace {

/// A thread of a pool that is kept from working, as by a busy core, until it is released.
struct Held {
  static inline std::atomic<bool> held{false}, released{false};
  std::atomic<long> thread{0};

  static void call(void* self, int thread, long) noexcept {
    if (thread > 0) static_cast<Held*>(self)->thread = syscall(SYS_gettid);
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1);
    while (std::chrono::steady_clock::now() < end) std::this_thread::yield();
  }
  static void hold(int) {
    held = true;
    while (!released) {
    }
  }
};

}  // namespace

TEST(AThreadThatCannotComeIsNotWaitedForAndHelpsAgainLater) {
  ThreadPool pool(2, false);
  Held held;
  for (int k = 0; k < 2000 && held.thread == 0; ++k) pool.run(4, {Held::call, &held});
  CHECK(held.thread != 0);
  const auto before = std::signal(SIGUSR1, Held::hold);
  syscall(SYS_tgkill, getpid(), held.thread.load(), SIGUSR1);
  while (!Held::held) std::this_thread::yield();
  alarm(60);  // a pool that waits for it never comes back
  Tally tally(12);
  pool.run(12, tally.work());
  alarm(0);
  CHECK(tally.each(1) && tally.highest == 0);
  Held::released = true;
  held.thread = 0;
  for (int k = 0; k < 2000 && held.thread == 0; ++k) pool.run(4, {Held::call, &held});
  CHECK(held.thread != 0);
  std::signal(SIGUSR1, before);
}

TEST(AForkedProcessDoesTheItemsWithItsOnlyThreadAndCanDestroyThePool) {
  auto pool = std::make_unique<ThreadPool>(3, false);
  Tally tally(20);
  pool->run(20, tally.work());
  std::this_thread::sleep_for(std::chrono::milliseconds(2));  // the threads sleep now
  const pid_t child = fork();
  if (child == 0) {
    alarm(20);
    pool->run(20, tally.work());
    pool.reset();
    _exit(tally.each(2) ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  pool->run(20, tally.work());
  CHECK(tally.each(2));
}
#endif

namespace {

// The register that says how this thread rounds and whether it flushes small numbers to zero.
#if defined(__x86_64__)
constexpr unsigned long kOther = 0xffc0, kSettings = ~0x3ful;  // below: what has happened so far
unsigned long control() { return __builtin_ia32_stmxcsr(); }
void set_control(unsigned long value) { __builtin_ia32_ldmxcsr(static_cast<unsigned>(value)); }
#elif defined(__aarch64__)
constexpr unsigned long kOther = 1ul << 24 | 3ul << 22, kSettings = ~0ul;
unsigned long control() {
  unsigned long value;
  asm volatile("mrs %0, fpcr" : "=r"(value));
  return value;
}
void set_control(unsigned long value) { asm volatile("msr fpcr, %0" : : "r"(value)); }
#endif

}  // namespace

TEST(EveryThreadRoundsToNearestAndKeepsSmallNumbersWhateverTheCallerDoes) {
  struct Small {
    std::atomic<int> kept{0};
    static void call(void* self, int, long) noexcept {
      volatile double tiny = 1e-308, ten = 10;
      const bool nearest = 1 / ten == 0.1;  // above a tenth
      static_cast<Small*>(self)->kept += tiny / 4 > 0 && nearest;
    }
  } small;
  const unsigned long before = control();
  set_control(kOther);  // flush to zero, round towards zero; new threads inherit it
  ThreadPool pool(3, false), one(1, false);
  pool.run(50, {Small::call, &small});
  one.run(50, {Small::call, &small});
  const bool left_as_it_was = (control() & kSettings) == (kOther & kSettings);
  set_control(before);
  CHECK(small.kept == 100);
  CHECK(left_as_it_was);
}
