// Who shares a pack: environments with the same set of points, whatever they carry going along.
#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "backend/cpu/grouping.h"
#include "check.h"

using namespace stickslip::backend;

namespace {

constexpr int kPoints = 12;

/// Environments in packs of `width`, with flags and numbers of both sizes that they carry.
struct Crowd {
  Crowd(int num_envs, int width, int points = kPoints)
      : num_envs(num_envs),
        width(width),
        points(points),
        padded((num_envs + width - 1) / width * width),
        grouping(num_envs, padded, width, points, 16),
        active(static_cast<size_t>(padded * points)),
        singles(static_cast<size_t>(padded * 5)),
        doubles(static_cast<size_t>(padded * 3)) {
    for (int env = 0; env < padded; ++env) {
      for (int k = 0; k < 5; ++k) singles[at(env, k, 5)] = static_cast<float>(10 * env + k);
      for (int k = 0; k < 3; ++k) doubles[at(env, k, 3)] = 10 * env + k;
    }
  }
  size_t at(long place, int k, int numbers) const {
    return static_cast<size_t>((place / width * numbers + k) * width + place % width);
  }
  void touch(int env, std::uint64_t set) {
    for (int k = 0; k < points; ++k)
      active[static_cast<size_t>(env * points + k)] = k < 64 && (set >> k & 1);
  }
  void regroup() {
    const LaneRows carried[] = {{reinterpret_cast<char*>(singles.data()), 5, 4},
                                {reinterpret_cast<char*>(doubles.data()), 3, 8}};
    for (long block = 0; block < grouping.blocks(); ++block)
      grouping.regroup(block, active.data(), carried);
    grouping.restart();
  }
  std::vector<std::uint8_t> set_of(int env) const {
    return {active.begin() + env * points, active.begin() + (env + 1) * points};
  }
  /// Different sets in a pack, summed over the packs.
  int sets_in_packs() const {
    int sum = 0;
    for (int pack = 0; pack < padded / width; ++pack) {
      std::set<std::vector<std::uint8_t>> sets;
      for (int place = pack * width; place < std::min((pack + 1) * width, num_envs); ++place)
        sets.insert(set_of(grouping.order()[place]));
      sum += static_cast<int>(sets.size());
    }
    return sum;
  }
  int packs() const { return padded / width; }

  int num_envs, width, points, padded;
  Grouping grouping;
  std::vector<std::uint8_t> active;
  std::vector<float> singles;
  std::vector<double> doubles;
};

/// Every environment has one place, and what it carries is there.
void check_whole(const Crowd& c) {
  bool whole = true;
  for (int env = 0; env < c.padded; ++env) {
    const long place = c.grouping.place(env);
    whole = whole && c.grouping.order()[place] == env;
    whole = whole && place / Grouping::kBlock == env / Grouping::kBlock;
    for (int k = 0; k < 5; ++k)
      whole = whole && c.singles[c.at(place, k, 5)] == static_cast<float>(10 * env + k);
    for (int k = 0; k < 3; ++k) whole = whole && c.doubles[c.at(place, k, 3)] == 10 * env + k;
    if (env >= c.num_envs) whole = whole && place == env;
  }
  CHECK(whole);
}

}  // namespace

TEST(EnvironmentsThatTouchWithTheSamePointsShareAPack) {
  for (const int width : {2, 4, 8, 16})
    for (const int points : {kPoints, 70}) {
      Crowd c(1001, width, points);
      std::mt19937 random(3);
      const std::uint64_t sets[] = {0, 9, 6, 4095, 1};
      for (int round = 0; round < 20; ++round) {
        for (int env = 0; env < c.num_envs; ++env) c.touch(env, sets[random() % 5]);
        const int before = c.sets_in_packs();
        c.regroup();
        check_whole(c);
        // At most one border per set and block.
        CHECK(c.sets_in_packs() <= c.packs() + 4 * static_cast<int>(c.grouping.blocks()));
        CHECK(round > 0 || before > c.packs() * 3 / 2);
      }
    }
}

TEST(SetsThatAreNeighborsDifferInFewPoints) {
  // All pairs of feet: packs at the border of two sets have three feet.
  Crowd c(96, 8, 4);
  std::mt19937 random(5);
  const std::uint64_t pairs[] = {3, 5, 6, 9, 10, 12};
  for (int env = 0; env < 96; ++env) c.touch(env, pairs[random() % 6]);
  c.regroup();
  int most = 0;
  for (int pack = 0; pack < c.packs(); ++pack) {
    int feet = 0;
    for (int k = 0; k < 4; ++k) {
      bool any = false;
      for (int place = 8 * pack; place < 8 * pack + 8; ++place)
        any = any || c.set_of(c.grouping.order()[place])[static_cast<size_t>(k)] != 0;
      feet += any;
    }
    most = std::max(most, feet);
  }
  CHECK(most == 3);
}

TEST(AnEnvironmentWhosePackStaysTheSameKeepsItsLane) {
  Crowd c(64, 8);
  for (int env = 0; env < 64; ++env) c.touch(env, env % 8);
  c.regroup();
  const std::vector<int> before(c.grouping.order(), c.grouping.order() + 64);
  c.regroup();  // nothing has changed
  CHECK(std::equal(before.begin(), before.end(), c.grouping.order()));
  // One environment changes over to another set and takes the place of one there, which goes on to
  // a third pack, ...: every pack keeps seven or eight of its own, where they were.
  c.touch(before[3], 7);
  c.regroup();
  check_whole(c);
  for (int pack = 0; pack < 8; ++pack) {
    int kept = 0;
    for (int place = 8 * pack; place < 8 * pack + 8; ++place)
      kept += c.grouping.order()[place] == before[static_cast<size_t>(place)];
    CHECK(kept >= 7);
  }
}

TEST(WhatDoesNotChangeIsRegroupedLessAndLessOften) {
  Crowd c(64, 8);
  const auto steps_until_due = [&] {
    int steps = 0;
    while (!c.grouping.due()) c.grouping.count(1), ++steps;
    c.regroup();
    return steps;
  };
  for (int env = 0; env < 64; ++env) c.touch(env, env % 8);
  CHECK(steps_until_due() == 16);
  CHECK(steps_until_due() == 16);  // the first one has moved many
  for (const int expected : {32, 64, 128, 256, 256, 256}) CHECK(steps_until_due() == expected);
  for (int env = 0; env < 64; ++env) c.touch(env, env / 8 + 1);
  CHECK(steps_until_due() == 256);
  CHECK(steps_until_due() == 16);
}

TEST(WhereThereIsNothingToGainNoRegroupingIsDue) {
  Grouping one_pack(8, 8, 8, kPoints, 16), one_lane(64, 64, 1, kPoints, 16),
      no_points(64, 64, 8, 0, 16), never(64, 64, 8, kPoints, 0);
  for (Grouping* g : {&one_pack, &one_lane, &no_points, &never}) {
    CHECK(g->part_of(1000) == 1000);
    g->count(1000);
    CHECK(!g->due());
  }
}

TEST(LongCallsAreCutWhereRegroupingIsDueAndShortRestsTakenAlong) {
  const Grouping often(64, 64, 8, kPoints, 16);
  for (const int steps : {1, 16, 20, 31}) CHECK(often.part_of(steps) == steps);
  CHECK(often.part_of(32) == 16 && often.part_of(1000) == 16);
  constexpr int kMost = std::numeric_limits<int>::max();
  Grouping seldom(64, 64, 8, kPoints, kMost);
  for (int k = 0; k < 6; ++k) seldom.restart();
  CHECK(seldom.part_of(kMost) == kMost && !seldom.due());
}
