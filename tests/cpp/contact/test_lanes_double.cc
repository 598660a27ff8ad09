// A lane of a pack has the bits of the plain solve, whatever its neighbors' contacts, shared joints
// and inputs are: double.
#include "contact/lanes_equal_plain.h"
#include "contact/write_out.h"

using namespace problems;
using contact::extract_lane;
using contact::insert_lane;
using contact::solve_lanes;
using contact::write_out;

TEST(LanesWithDifferentContactsHaveThePlainBits) {
  const FactoredOptions o;
  compare_all<Pack<double, 2>>(o, 1000);
  compare_all<Pack<double, 4>>(o, 1000);
  compare_all<Pack<double, 8>>(o, 1000);
}

TEST(LanesThatTakeTheFallbackAndJamsAreAmongThem) {
  const FactoredOptions o;
  const Mix real = compare<Pack<double, 4>>(kFeet, false, 1000, o, 1);
  CHECK(real.fallbacks > 20);
  CHECK(real.many > 300 && real.empty > 30 && real.fewer_slots > 500);
  const Mix soles = compare<Pack<double, 4>>(kSolesOf, false, 1000, o, 2);
  CHECK(soles.fewer_dofs > 300 && soles.other_path > 50);
  const Mix arms = compare<Pack<double, 4>>(kArm, false, 300, o, 3);
  CHECK(arms.unsolved > 50);
  for (const Mix& m : {real, soles, arms}) CHECK(m.different == 0);
}

TEST(MaximumDissipationHasThePlainBitsToo) {
  FactoredOptions o;
  o.max_dissipation = true;
  compare_all<Pack<double, 4>>(o, 400);
}

TEST(LanesWithInputsThatAreNotFiniteLeaveTheOthersAlone) {
  const FactoredOptions o;
  for (int family = 0; family < kNumLaneFamilies; ++family) {
    const Mix m = compare<Pack<double, 4>>(family, false, 300, o, 10 + family, 0.25);
    CHECK(m.spoiled > 30);
    CHECK(m.different == 0);
  }
}

TEST(AnExtractedLaneIsThePlainProblem) {
  using S = Pack<double, 4>;
  const contact::FactoredCapacity capacity{24, kMaxDofs};
  Owned<S> wide(capacity);
  Owned<double> plain(capacity), lane(capacity);
  Random rng(5);
  long compared = 0;
  for (int n = 0; n < 300; ++n) {
    const Places places = places_of(n % kNumLaneFamilies, false, rng);
    LaneProblem lanes[4];
    for (LaneProblem& l : lanes) l = random_lane(n % kNumLaneFamilies, places, 0, 8, rng);
    build(wide.p, places, lanes, layout_of(places, lanes, 4));
    solve_factored(wide.p);  // leaves the inputs of a lane's own contacts as they are
    for (int l = 0; l < 4; ++l) {
      build(plain.p, places, lanes + l, layout_of(places, lanes + l, 1));
      extract_lane(wide.p, l, lane.p);
      const int size = plain.p.size();
      CHECK(lane.p.size() == size);
      std::vector<double> a(9 * size * size + 7 * size), b(a);
      const auto out = [size](const FactoredProblem<double>& p, std::vector<double>& x) {
        double* c = x.data() + 9 * size * size;
        std::vector<double> lambda(3 * size);
        write_out(p, x.data(), c, c + 3 * size, lambda.data());
      };
      for (int i = 0; i < size; ++i) {
        plain.p.complete(i);
        lane.p.complete(i);
      }
      out(plain.p, a), out(lane.p, b);
      for (size_t k = 0; k < a.size(); ++k, ++compared) CHECK(same_bits(a[k], b[k]));
    }
  }
  CHECK(compared > 10000);
}

TEST(AHostMayImproveOneLane) {
  using S = Pack<double, 4>;
  const contact::FactoredCapacity capacity{24, kMaxDofs};
  Owned<S> p(capacity);
  Random rng(6);
  const Places places = places_of(kHumanoid, false, rng);
  LaneProblem lanes[4];
  for (LaneProblem& l : lanes) l = random_lane(kHumanoid, places, 2, 6, rng);
  const Layout all = layout_of(places, lanes, 4);
  build(p.p, places, lanes, all);
  solve_factored(p.p);
  const S one = constant<S>(1);
  S chosen = constant<S>(0);
  set_lane(chosen, 2, 1.0);
  S before[24][3], w = p.p.w[0];
  for (int c = 0; c < p.p.size(); ++c)
    for (int r = 0; r < 3; ++r) before[c][r] = p.p.impulse(c)[r];
  int calls = 0;
  solve_lanes(p.p, chosen >= one, [&](FactoredProblem<double>& q, int lane) {
    ++calls;
    CHECK(lane == 2);
    CHECK(q.size() == lanes[2].contacts());
    for (int c = 0; c < q.size(); ++c) q.impulse(c)[2] += 1 + c;
    q.w[0] += 0.5;
  });
  CHECK(calls == 1);
  for (int c = 0, own = 0; c < p.p.size(); ++c) {
    const bool mine = lanes[2].slots[all.slots[c]].active;
    for (int l = 0; l < 4; ++l)
      for (int r = 0; r < 3; ++r)
        CHECK(get_lane(p.p.impulse(c)[r], l) ==
              get_lane(before[c][r], l) + (l == 2 && mine && r == 2 ? 1 + own : 0));
    own += mine;
  }
  for (int l = 0; l < 4; ++l) CHECK(get_lane(p.p.w[0], l) == get_lane(w, l) + (l == 2 ? 0.5 : 0));
}
