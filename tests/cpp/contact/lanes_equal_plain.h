// Solves lanes of random problems together and alone; every bit has to agree.
#pragma once
#include "check.h"
#include "contact/lane_problems.h"

namespace problems {

using contact::FactoredInfo;
using contact::FactoredOptions;
using contact::Owned;

/// A zero may have either sign (docs/limits.md).
template <class T>
bool same_bits(T a, T b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (a == 0 && b == 0);
}

/// What the lanes of a comparison were like.
struct Mix {
  long lanes = 0, different = 0, fallbacks = 0, unsolved = 0, other_path = 0, fewer_slots = 0,
       fewer_dofs = 0, many = 0, empty = 0, spoiled = 0;
};

/// Makes one input of a lane NaN, or infinite.
template <class S>
void spoil(FactoredProblem<S>& p, int c, int lane, int what) {
  using T = Value<S>;
  S* const places[] = {p.offset(c),
                       p.impulse(c) + 2,
                       p.private_block(c) + 3,
                       &p.friction(c),
                       p.impulse(c),
                       p.offset(c) + 2,
                       p.w0};
  set_lane(*places[what % 7], lane, what % 7 == 1 ? T(INFINITY) : T(NAN));
}

/// `spoiled_share` of the lanes have an input that is not finite.
template <class S>
Mix compare(int family, bool any_chain, int rounds, const FactoredOptions& o, unsigned seed,
            double spoiled_share = 0) {
  using T = Value<S>;
  constexpr int kLanes = ScalarTraits<S>::kWidth;
  const contact::FactoredCapacity capacity{24, kMaxDofs};
  static Owned<S> wide(capacity);
  static Owned<T> plain(capacity);
  Random rng(seed);
  Mix mix;
  for (int n = 0; n < rounds; n += kLanes) {
    const Places places = places_of(family, any_chain, rng);
    LaneProblem lanes[kLanes];
    // Rounds of few contacts and of many.
    const bool crowded = rng.below(2);
    for (LaneProblem& l : lanes)
      l = random_lane(family, places, crowded ? 8 : 0, crowded ? 12 : 4, rng);
    const Layout all = layout_of(places, lanes, kLanes);
    if (all.slots.empty()) continue;
    build(wide.p, places, lanes, all);
    int what[kLanes];
    for (int l = 0; l < kLanes; ++l) {
      what[l] = rng.uniform() < spoiled_share && lanes[l].contacts() > 0 ? rng.below(1000) : -1;
      if (what[l] < 0) continue;
      // The first contact of the lane.
      size_t c = 0;
      while (!lanes[l].slots[all.slots[c]].active) ++c;
      spoil(wide.p, int(c), l, places.base_dofs ? what[l] : what[l] = what[l] % 6);
    }
    const FactoredInfo<S> info = solve_factored(wide.p, o);
    for (int l = 0; l < kLanes; ++l) {
      const Layout own = layout_of(places, lanes + l, 1);
      long different = 0;
      const auto expect = [&](T a, T b) { different += !same_bits(a, b); };
      for (int c = 0; c < wide.p.size(); ++c)
        if (!lanes[l].slots[all.slots[c]].active)
          for (int r = 0; r < 3; ++r) expect(get_lane(wide.p.impulse(c)[r], l), T(0));
      ++mix.lanes;
      mix.empty += own.slots.empty();
      build(plain.p, places, lanes + l, own);
      if (what[l] >= 0) {
        spoil(plain.p, 0, 0, what[l]);
        ++mix.spoiled;
      }
      const FactoredInfo<T> alone = solve_factored(plain.p, o);
      if (what[l] >= 0) {
        different += alone.converged || get_lane(info.converged, l);
        for (int c = 0; c < wide.p.size(); ++c)
          for (int r = 0; r < 3; ++r) expect(get_lane(wide.p.impulse(c)[r], l), T(0));
        for (int k = 1; k < wide.p.dofs(); ++k)
          expect(get_lane(wide.p.w[k], l), get_lane(wide.p.w0[k], l));
      } else {
        mix.fallbacks += alone.fallbacks;
        mix.unsolved += !alone.converged;
        mix.other_path += wide.p.six() != plain.p.six();
        mix.fewer_slots += own.slots.size() < all.slots.size();
        mix.fewer_dofs += own.joints.size() < all.joints.size();
        mix.many += own.slots.size() >= 8;
        different += get_lane(info.converged, l) != alone.converged;
        expect(get_lane(info.residual, l), alone.residual);
        for (int c = 0, k = 0; c < wide.p.size(); ++c) {
          if (!lanes[l].slots[all.slots[c]].active) continue;
          for (int r = 0; r < 3; ++r) {
            expect(get_lane(wide.p.impulse(c)[r], l), plain.p.impulse(k)[r]);
            expect(get_lane(wide.p.velocity(c)[r], l), plain.p.velocity(k)[r]);
          }
          ++k;
        }
        for (int k = 0; k < wide.p.dofs(); ++k) {
          const int joint = k < places.base_dofs ? -1 : all.joints[k - places.base_dofs];
          const int dof = joint < 0 ? k : own.dof_of[joint];
          expect(get_lane(wide.p.w[k], l), dof < 0 ? T(0) : plain.p.w[dof]);
        }
      }
      mix.different += different > 0;
    }
  }
  return mix;
}

template <class S>
void compare_all(const FactoredOptions& o, int rounds) {
  for (int family = 0; family < kNumLaneFamilies; ++family)
    for (const bool any_chain : {false, true}) {
      if (any_chain && family == kFeet) continue;
      // Jams are slow.
      const int n = family == kArm ? rounds / 5 : rounds;
      const Mix m = compare<S>(family, any_chain, n, o, 100 * family + any_chain);
      std::printf(
          "  x%-2d %-18s lanes %ld: with fewer contacts %ld, fewer dofs %ld, on the other path "
          "%ld, 8 to 12 contacts %ld, none %ld, fallbacks %ld, unsolved %ld; different %ld\n",
          ScalarTraits<S>::kWidth, family_name(family), m.lanes, m.fewer_slots, m.fewer_dofs,
          m.other_path, m.many, m.empty, m.fallbacks, m.unsolved, m.different);
      CHECK(m.different == 0);
    }
}

}  // namespace problems
