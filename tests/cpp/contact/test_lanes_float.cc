// A lane of a pack has the bits of the plain solve, whatever its neighbors' contacts, shared joints
// and inputs are: float.
#include "contact/lanes_equal_plain.h"

using namespace problems;

TEST(LanesWithDifferentContactsHaveThePlainBits) {
  const FactoredOptions o = contact::default_options<float>();
  compare_all<Pack<float, 4>>(o, 1000);
  compare_all<Pack<float, 8>>(o, 1000);
  compare_all<Pack<float, 16>>(o, 1000);
}

TEST(LanesThatTakeTheFallbackAndJamsAreAmongThem) {
  const FactoredOptions o = contact::default_options<float>();
  const Mix real = compare<Pack<float, 8>>(kFeet, false, 1000, o, 1);
  CHECK(real.fallbacks > 10);
  CHECK(real.many > 300 && real.empty > 30 && real.fewer_slots > 500);
  const Mix arms = compare<Pack<float, 8>>(kArm, false, 300, o, 3);
  CHECK(arms.unsolved > 50);
  for (const Mix& m : {real, arms}) CHECK(m.different == 0);
}

TEST(MaximumDissipationHasThePlainBitsToo) {
  FactoredOptions o = contact::default_options<float>();
  o.max_dissipation = true;
  compare_all<Pack<float, 8>>(o, 400);
}

TEST(LanesWithInputsThatAreNotFiniteLeaveTheOthersAlone) {
  const FactoredOptions o = contact::default_options<float>();
  for (int family = 0; family < kNumLaneFamilies; ++family) {
    const Mix m = compare<Pack<float, 8>>(family, false, 300, o, 10 + family, 0.25);
    CHECK(m.spoiled > 30);
    CHECK(m.different == 0);
  }
}
