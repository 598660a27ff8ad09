// Contact problems of bodies with several contacts, on chains of joints of their own or shared:
// each built as the lanes of a pack, and lane by lane alone.
#pragma once
#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "check.h"
#include "contact/factored.h"
#include "contact/owned_problem.h"
#include "scenes/random.h"

namespace body_problems {

using namespace stickslip;
using namespace stickslip::contact;
using scenes::Random;

using Column = std::array<double, 6>;

/// What one lane knows of a body: columns of its twist, and the contacts that it has there.
struct LaneBody {
  std::vector<Column> columns;  // per dof of the body
  std::vector<std::array<double, 3>> arms, offsets;
  std::vector<double> frictions;
  std::vector<bool> active;
  int contacts() const { return int(std::count(active.begin(), active.end(), true)); }
};

/// Which dofs a body touches is the same in all lanes.
struct Robot {
  int base;  // dofs of the base: 6 or 0
  int dofs;
  std::vector<std::vector<int>> body_dofs;  // ascending; the base's first
  std::vector<std::vector<LaneBody>> lanes;
};

/// A floating or fixed base with bodies on chains of joints, some of them on a joint that belongs
/// to another's chain.
inline Robot random_robot(Random& rng) {
  Robot robot;
  robot.base = robot.dofs = rng.below(3) ? 6 : 0;
  for (int b = 1 + rng.below(4); b > 0; --b) {
    std::vector<int> dofs;
    for (int k = 0; k < robot.base; ++k) dofs.push_back(k);
    if (!robot.body_dofs.empty() && rng.below(3) == 0) {
      const std::vector<int>& other = robot.body_dofs.back();
      for (size_t k = robot.base; k < other.size() && rng.below(3) > 0; ++k)
        dofs.push_back(other[k]);
    }
    for (int k = 1 + rng.below(6); k > 0; --k) dofs.push_back(robot.dofs++);
    robot.body_dofs.push_back(dofs);
  }
  return robot;
}

inline LaneBody random_lane(const std::vector<int>& dofs, int contacts, Random& rng) {
  LaneBody body;
  for (size_t k = 0; k < dofs.size(); ++k) {
    Column& c = body.columns.emplace_back();
    for (double& x : c) x = rng.normal();
  }
  const int idle = rng.below(4);
  for (int i = 0; i < contacts; ++i) {
    body.arms.push_back({0.1 * rng.normal(), 0.1 * rng.normal(), 0.1 * rng.normal()});
    body.offsets.push_back({rng.normal(), rng.normal(), rng.normal() - 1});
    body.frictions.push_back(rng.uniform());
    body.active.push_back(idle == 0 ? false : idle == 1 ? rng.below(2) > 0 : true);
  }
  return body;
}

inline std::array<double, 3> at_arm(const Column& c, const std::array<double, 3>& d) {
  return {c[0] + c[4] * d[2] - c[5] * d[1], c[1] + c[5] * d[0] - c[3] * d[2],
          c[2] + c[3] * d[1] - c[4] * d[0]};
}

/// A joint of a lane: contacts below, of one body or more.
struct Below {
  int contacts = 0, bodies = 0;
};

/// The problem of some lanes of a robot, as ContactStage builds it: joints below one contact go to
/// its private block.
template <class S>
void build(FactoredProblem<S>& p, const Robot& robot, const std::vector<int>& lanes) {
  const auto gather = [&](auto&& number) {
    S out = constant<S>(0);
    for (size_t l = 0; l < lanes.size(); ++l) set_lane(out, int(l), Value<S>(number(lanes[l])));
    return out;
  };
  const auto where = [&](auto&& holds) {
    return gather([&](int lane) { return holds(lane) ? 1.0 : 0.0; }) > constant<S>(0.5);
  };
  std::vector<std::vector<Below>> below(robot.lanes.size(), std::vector<Below>(robot.dofs));
  for (int lane : lanes)
    for (size_t b = 0; b < robot.body_dofs.size(); ++b)
      if (const int n = robot.lanes[lane][b].contacts())
        for (int dof : robot.body_dofs[b])
          below[lane][dof].contacts += n, ++below[lane][dof].bodies;
  const auto shared = [&](int lane, int dof) {
    return dof < robot.base || below[lane][dof].contacts > 1;
  };
  const auto common = [&](int lane, int dof) {
    return dof < robot.base || below[lane][dof].bodies > 1;
  };

  p.clear(robot.dofs);
  for (int k = 0; k < robot.dofs; ++k) p.w0[k] = constant<S>(0.1 * k);
  for (size_t b = 0; b < robot.body_dofs.size(); ++b) {
    const auto of = [&](int lane) -> const LaneBody& { return robot.lanes[lane][b]; };
    std::vector<int> index;
    for (int dof : robot.body_dofs[b])
      if (std::any_of(lanes.begin(), lanes.end(), [&](int l) { return shared(l, dof); }))
        index.push_back(dof);
    const auto position = [&](int dof) {
      const std::vector<int>& all = robot.body_dofs[b];
      return std::find(all.begin(), all.end(), dof) - all.begin();
    };
    const int first = p.size();
    for (size_t i = 0; i < of(lanes[0]).active.size(); ++i) {
      const Mask<S> active = where([&](int lane) { return bool(of(lane).active[i]); });
      if (!any(active)) continue;
      FactoredContact<S>& c = p.contact(p.add());
      p.set_index(p.size() - 1, index.data(), int(index.size()));
      c.active = active;
      c.friction = gather([&](int lane) { return of(lane).frictions[i]; });
      const auto row = [&](int lane, int dof) {
        return at_arm(of(lane).columns[position(dof)], of(lane).arms[i]);
      };
      for (size_t k = 0; k < index.size(); ++k) {
        S y[3];
        for (int r = 0; r < 3; ++r)
          y[r] = gather(
              [&](int lane) { return shared(lane, index[k]) ? row(lane, index[k])[r] : 0.0; });
        c.y[k] = make_row3(y[0], y[1], y[2]);
      }
      for (int r = 0; r < 3; ++r) {
        c.offset[r] = gather([&](int lane) { return of(lane).offsets[i][r]; });
        c.arm[r] = gather([&](int lane) { return of(lane).arms[i][r]; });
      }
      for (int r = 0, at = 0; r < 3; ++r)
        for (int s = r; s < 3; ++s, ++at)
          c.private_block[at] = gather([&](int lane) {
            double sum = 0;
            for (int dof : robot.body_dofs[b])
              if (!shared(lane, dof)) sum += row(lane, dof)[r] * row(lane, dof)[s];
            return sum;
          });
    }
    const Mask<S> several = where([&](int lane) { return of(lane).contacts() > 1; });
    if (!any(several)) continue;
    ContactBody<S>& body = p.add_body(first, p.size(), several);
    for (int dof : index) {
      const auto column_where = [&](auto&& holds) {
        std::array<S, 6> column;
        for (int r = 0; r < 6; ++r)
          column[r] = gather([&](int lane) {
            return of(lane).contacts() > 1 && holds(lane) ? of(lane).columns[position(dof)][r]
                                                          : 0.0;
          });
        return column;
      };
      const auto owns = [&](int lane) { return !common(lane, dof); };
      const auto leaves = [&](int lane) { return common(lane, dof); };
      if (any(several & where(owns))) body.add_own(column_where(owns).data());
      if (any(several & where(leaves))) body.add_left(dof, column_where(leaves).data());
    }
  }
  for (int i = 0; i < p.size(); ++i) {
    p.complete(i);
    prepare_contact<0>(p.contact(i));
  }
  accumulate<0>(p);
}

/// w, impulses and velocities of a lane, and its part of `more`.
template <class S>
std::vector<double> result(const FactoredProblem<S>& p, const std::vector<S>& more, int lane = 0) {
  std::vector<double> out;
  for (int k = 0; k < p.dofs(); ++k) out.push_back(get_lane(p.w[k], lane));
  for (int i = 0; i < p.size(); ++i) {
    const FactoredContact<S>& c = p.contact(i);
    if (!get_lane(c.active, lane)) continue;
    S l[3];
    store(c.lambda, l);
    for (const S& x : l) out.push_back(get_lane(x, lane));
    for (const S& x : c.velocity) out.push_back(get_lane(x, lane));
  }
  for (const S& x : more) out.push_back(get_lane(x, lane));
  return out;
}

inline constexpr FactoredCapacity kCapacity{24, 40, 4};

/// A robot with the states of as many lanes.
inline Robot random_lanes(int lanes, Random& rng) {
  Robot robot = random_robot(rng);
  std::vector<int> contacts;
  for (size_t b = 0; b < robot.body_dofs.size(); ++b) contacts.push_back(1 + rng.below(5));
  for (int lane = 0; lane < lanes; ++lane) {
    auto& bodies = robot.lanes.emplace_back();
    for (size_t b = 0; b < contacts.size(); ++b)
      bodies.push_back(random_lane(robot.body_dofs[b], contacts[b], rng));
  }
  return robot;
}

/// What the problems of a comparison had in them.
struct Seen {
  long single = 0, own = 0, common = 0;  // contacts alone on their body, own dofs, common joints
  template <class S>
  void add(FactoredProblem<S>& p, int base) {
    for (int i = 0; i < p.num_bodies(); ++i) {
      own += p.body(i).own_count();
      common += p.body(i).left_count() - base;
    }
    for (int i = 0; i < p.size(); ++i) single += p.contact(i).body >= 0 && p.contact(i).single;
  }
};

inline bool same(double a, double b) { return a == b || (a != a && b != b); }

/// f(problem, lanes, number) works on the problem of these lanes and returns what to compare
/// besides the problem: on packs and on each lane alone. No number may differ.
template <class Wide, class F>
void compare_lanes(unsigned seed, int problems, const F& f) {
  using S = Value<Wide>;
  constexpr int kWidth = ScalarTraits<Wide>::kWidth;
  Owned<S> plain(kCapacity);
  Owned<Wide> wide(kCapacity);
  Random rng(seed);
  long different = 0, compared = 0;
  Seen seen;
  for (int n = 0; n < problems; ++n) {
    const Robot robot = random_lanes(kWidth, rng);
    std::vector<int> lanes(kWidth);
    std::iota(lanes.begin(), lanes.end(), 0);
    build(wide.p, robot, lanes);
    seen.add(wide.p, robot.base);
    const std::vector<Wide> more = f(wide.p, lanes, n);
    for (int lane = 0; lane < kWidth; ++lane) {
      build(plain.p, robot, {lane});
      const std::vector<S> expected_more = f(plain.p, std::vector<int>{lane}, n);
      const std::vector<double> expected = result(plain.p, expected_more),
                                got = result(wide.p, more, lane);
      CHECK(got.size() == expected.size());
      for (size_t k = 0; k < got.size(); ++k) different += !same(got[k], expected[k]);
      compared += long(got.size());
    }
  }
  std::printf("  different %ld of %ld; single %ld, own dofs %ld, common joints %ld\n", different,
              compared, seen.single, seen.own, seen.common);
  CHECK(different == 0);
  CHECK(seen.single > problems / 3 && seen.own > 5 * problems && seen.common > problems / 2);
}

}  // namespace body_problems
