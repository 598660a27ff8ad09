// The gate of a round of work: who is let in, and who is waited for.
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
