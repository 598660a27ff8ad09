// Threads that share items: each is done once, whatever the numbers of both, round after round.
#include <chrono>
#ifdef __linux__
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>
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

  static void call(void* self, int thread, long item) {
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
    static void call(void* self, int thread, long item) {
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
    static void call(void* self, int, long) {
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

TEST(RunReturnsAfterTheSlowestItem) {
  struct Slow {
    std::atomic<int> done{0};
    static void call(void* self, int, long item) {
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

TEST(PinningLeavesTheCallingThreadFree) {
  CHECK(!usable_cores().empty());
#ifdef __linux__
  cpu_set_t before, after;
  sched_getaffinity(0, sizeof before, &before);
  {
    ThreadPool pool(2, true);
    Tally tally(10);
    pool.run(10, tally.work());
    CHECK(tally.each(1));
  }
  sched_getaffinity(0, sizeof after, &after);
  CHECK(CPU_EQUAL(&before, &after));
#endif
}

#ifdef __linux__
TEST(AForkedProcessDoesTheItemsWithItsOnlyThread) {
  ThreadPool pool(3, false);
  Tally tally(20);
  pool.run(20, tally.work());
  const pid_t child = fork();
  if (child == 0) {
    pool.run(20, tally.work());
    _exit(tally.each(2) ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  pool.run(20, tally.work());
  CHECK(tally.each(2));
}
#endif

#ifdef __x86_64__
TEST(EveryThreadRoundsToNearestAndKeepsSmallNumbersWhateverTheCallerDoes) {
  struct Small {
    std::atomic<int> kept{0};
    static void call(void* self, int, long) {
      volatile double tiny = 1e-308, ten = 10;
      const bool nearest = 1 / ten == 0.1;  // above a tenth
      static_cast<Small*>(self)->kept += tiny / 4 > 0 && nearest;
    }
  } small;
  const unsigned before = __builtin_ia32_stmxcsr();
  __builtin_ia32_ldmxcsr(0xffc0);  // flush to zero, round towards zero; new threads inherit it
  ThreadPool pool(3, false), one(1, false);
  pool.run(50, {Small::call, &small});
  one.run(50, {Small::call, &small});
  const bool left_as_it_was = __builtin_ia32_stmxcsr() >> 6 == 0xffc0u >> 6;
  __builtin_ia32_ldmxcsr(before);
  CHECK(small.kept == 100);
  CHECK(left_as_it_was);
}
#endif
