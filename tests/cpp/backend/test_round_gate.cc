// The gate of a round of work: who is let in, and who is waited for.
#include <cstdint>
#include <thread>
#include <vector>

#include "backend/cpu/round_gate.h"
#include "check.h"

using stickslip::backend::RoundGate;

TEST(AnOpenGateAdmitsEachHelperOncePerRound) {
  RoundGate gate;
  std::uint64_t first = 0, second = 0;
  CHECK(!gate.admits(first) && !gate.enter(first));  // closed at the beginning
  gate.open();
  CHECK(gate.round() == 1);
  CHECK(gate.admits(first) && gate.enter(first) && first == 1);
  CHECK(!gate.admits(first) && !gate.enter(first));
  CHECK(gate.enter(second) && second == 1);
  gate.close();
  CHECK(!gate.leave());
  CHECK(gate.leave());
  gate.open();
  CHECK(gate.round() == 2);
  CHECK(gate.enter(first) && first == 2);
}

TEST(WhoComesAfterTheGateWasClosedIsNeitherLetInNorWaitedFor) {
  RoundGate gate;
  std::uint64_t late = 0;
  gate.open();
  gate.close();
  CHECK(gate.empty());
  CHECK(!gate.admits(late) && !gate.enter(late) && late == 0);
  gate.open();
  CHECK(gate.enter(late) && late == 2);  // it missed a round, not the next
}

TEST(AClosedGateIsEmptyOnlyWhenTheLastHasLeft) {
  RoundGate gate;
  std::uint64_t first = 0, second = 0, third = 0;
  gate.open();
  CHECK(gate.empty());
  CHECK(gate.enter(first) && gate.enter(second));
  CHECK(!gate.leave());  // open: nobody waits yet
  gate.close();
  CHECK(!gate.empty());
  CHECK(gate.leave() && gate.empty());
  gate.open();
  CHECK(gate.enter(third) && !gate.empty());
}

TEST(WhatIsWrittenBeforeARoundIsSeenInsideAndWhatIsWrittenInsideAfterIt) {
  constexpr int kHelpers = 3, kRounds = 20000;
  RoundGate gate;
  std::atomic<bool> stop{false};
  std::uint64_t task = 0;  // plain numbers: only the gate orders their uses
  std::uint64_t seen_by[kHelpers] = {};
  bool right = true;
  std::vector<std::thread> helpers;
  for (int k = 0; k < kHelpers; ++k)
    helpers.emplace_back([&, k] {
      for (std::uint64_t seen = 0; !stop; std::this_thread::yield())
        if (gate.enter(seen)) {
          seen_by[k] = task;
          gate.leave();
        }
    });
  long helped = 0;
  for (std::uint64_t round = 1; round <= kRounds || helped == 0; ++round) {
    task = round;
    gate.open();
    if (round % 16 == 0) std::this_thread::yield();
    gate.close();
    while (!gate.empty()) std::this_thread::yield();
    for (std::uint64_t& seen : seen_by) {
      right = right && (seen == 0 || seen == round);
      helped += seen == round;
      seen = 0;
    }
  }
  stop = true;
  for (std::thread& helper : helpers) helper.join();
  CHECK(right);
  CHECK(helped > 0);
}
