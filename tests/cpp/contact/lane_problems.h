// Robot-like contact problems whose lanes differ in everything a lane may differ in: which contacts
// it has, which joints its contacts share, and its numbers. Each is built twice, as a lane of a
// pack over what all lanes need, and alone.
#pragma once
#include <cmath>
#include <cstring>
#include <vector>

#include "contact/factored.h"
#include "contact/owned_problem.h"
#include "scenes/quadruped.h"

namespace problems {

using namespace stickslip;
using contact::FactoredProblem;
using scenes::Random;

inline constexpr int kMaxDofs = 40;

/// A robot with the places where it may touch: what all lanes have in common.
struct Places {
  int base_dofs = 6;
  std::vector<int> chain;               // of joint j: 0 or 1
  std::vector<std::vector<int>> paths;  // joints of slot i, from the base outward, ascending
  int dofs() const { return base_dofs + int(chain.size()); }
};

/// One lane: which slots it has, and their numbers.
struct LaneProblem {
  struct Slot {
    bool active = false;
    double base[6][3], joint[12][3];  // rows, along the path
    double free[3], impulse[3], friction;
  };
  std::vector<Slot> slots;
  double x[kMaxDofs];  // free motion, base first

  int contacts() const {
    int n = 0;
    for (const Slot& s : slots) n += s.active;
    return n;
  }
  /// How many of its contacts move joint j.
  int uses(const Places& places, int j) const {
    int n = 0;
    for (size_t i = 0; i < slots.size(); ++i)
      if (slots[i].active)
        for (int k : places.paths[i]) n += k == j;
    return n;
  }
};

/// The slots and dofs of a problem, ascending: those that any of its lanes needs.
struct Layout {
  std::vector<int> slots, joints;
  int dof_of[kMaxDofs];  // of a joint, -1 where no lane shares it
};
inline Layout layout_of(const Places& places, const LaneProblem* lanes, int num_lanes) {
  Layout u;
  for (size_t i = 0; i < places.paths.size(); ++i) {
    bool any = false;
    for (int l = 0; l < num_lanes; ++l) any = any || lanes[l].slots[i].active;
    if (any) u.slots.push_back(int(i));
  }
  for (size_t j = 0; j < places.chain.size(); ++j) {
    bool shared = false;
    for (int l = 0; l < num_lanes; ++l) shared = shared || lanes[l].uses(places, int(j)) > 1;
    u.dof_of[j] = shared ? places.base_dofs + int(u.joints.size()) : -1;
    if (shared) u.joints.push_back(int(j));
  }
  return u;
}

/// Builds the problem of the lanes (one, where S is a plain scalar).
template <class S>
void build(FactoredProblem<S>& p, const Places& places, const LaneProblem* lanes, const Layout& u) {
  using T = Value<S>;
  constexpr int kLanes = ScalarTraits<S>::kWidth;
  const int base = places.base_dofs;
  bool odd[kMaxDofs];
  for (int k = 0; k < base; ++k) odd[k] = k & 1;
  for (size_t k = 0; k < u.joints.size(); ++k) odd[base + k] = places.chain[u.joints[k]];
  p.clear(base + int(u.joints.size()), odd);
  for (int l = 0; l < kLanes; ++l) {
    for (int k = 0; k < base; ++k) set_lane(p.w0[k], l, T(lanes[l].x[k]));
    for (size_t k = 0; k < u.joints.size(); ++k)
      if (lanes[l].uses(places, u.joints[k]) > 1)
        set_lane(p.w0[base + k], l, T(lanes[l].x[base + u.joints[k]]));
  }
  for (int i : u.slots) {
    const int c = p.add();
    const std::vector<int>& path = places.paths[i];
    int index[kMaxDofs], count = 0;
    S rows[kMaxDofs][3], mask = constant<S>(0);
    for (auto& row : rows)
      for (S& r : row) r = constant<S>(0);
    for (int k = 0; k < base; ++k) index[count++] = k;
    for (int j : path)
      if (u.dof_of[j] >= 0) index[count++] = u.dof_of[j];
    for (int l = 0; l < kLanes; ++l) {
      const LaneProblem::Slot& s = lanes[l].slots[i];
      const auto put = [l](S& to, double from) { set_lane(to, l, T(from)); };
      // Where the lane does not have the slot the inputs are garbage.
      const double poison = s.active ? 0 : __builtin_nan("");
      set_lane(mask, l, T(s.active));
      for (int k = 0; k < base; ++k)
        for (int r = 0; r < 3; ++r) put(rows[k][r], s.base[k][r] + poison);
      T block[6] = {}, offset[3];
      for (int r = 0; r < 3; ++r) offset[r] = T(s.free[r] + poison);
      int at = base;
      for (size_t k = 0; k < path.size(); ++k) {
        const T z[3] = {T(s.joint[k][0]), T(s.joint[k][1]), T(s.joint[k][2])};
        const bool shared = lanes[l].uses(places, path[k]) > 1;
        if (u.dof_of[path[k]] >= 0) {
          for (int r = 0; r < 3; ++r) put(rows[at][r], shared || !s.active ? z[r] + poison : 0);
          ++at;
        }
        if (shared) continue;
        for (int r = 0, b = 0; r < 3; ++r) {
          for (int q = r; q < 3; ++q, ++b) block[b] = madd(z[r], z[q], block[b]);
          offset[r] = madd(z[r], T(lanes[l].x[base + path[k]]), offset[r]);
        }
      }
      for (int b = 0; b < 6; ++b) put(p.private_block(c)[b], double(block[b]) + poison);
      for (int r = 0; r < 3; ++r) {
        put(p.offset(c)[r], offset[r]);
        put(p.impulse(c)[r], s.impulse[r] + poison);
      }
      put(p.friction(c), s.friction + poison);
    }
    p.active(c) = mask > constant<S>(0);
    if (!(base == 6 && u.joints.empty())) p.set_index(c, index, count);
    for (int k = 0; k < count; ++k) p.y(c)[k] = make_row3(rows[k][0], rows[k][1], rows[k][2]);
  }
}

// ---- families

enum LaneFamily {
  kFeet,      ///< a quadruped's feet and torso corners: six shared dofs, always
  kSolesOf,   ///< its soles and torso corners: legs shared where they stand on several points
  kHumanoid,  ///< legs, and arms on a common waist, touching with links of every depth
  kArm,       ///< two arms of two joints on the ground: jams
  kNumLaneFamilies
};
inline const char* family_name(int f) {
  const char* names[] = {"feet and corners", "soles and corners", "humanoid", "arms"};
  return names[f];
}

/// `any_chain`: joints lie in random chains instead of those of their depth.
inline Places places_of(int family, bool any_chain, Random& rng) {
  Places p;
  std::vector<int> depth;
  const auto branch = [&](std::vector<int> path, int joints) {
    for (int k = 0; k < joints; ++k) {
      path.push_back(int(p.chain.size()));
      p.chain.push_back(any_chain ? rng.below(2) : int(p.base_dofs + path.size() - 1) & 1);
    }
    return path;
  };
  const auto prefix = [](const std::vector<int>& path, size_t n) {
    return std::vector<int>(path.begin(), path.begin() + std::min(n, path.size()));
  };
  if (family == kFeet || family == kSolesOf) {
    for (int leg = 0; leg < 4; ++leg) {
      const auto path = branch({}, 3);
      for (int k = 0; k < (family == kFeet ? 1 : 4); ++k) p.paths.push_back(path);
    }
    for (int k = 0; k < 8; ++k) p.paths.push_back({});
  } else if (family == kHumanoid) {
    for (int leg = 0; leg < 2; ++leg) {
      const auto path = branch({}, 6);
      for (int k = 0; k < 4; ++k) p.paths.push_back(path);
      p.paths.push_back(prefix(path, 3));
    }
    const auto waist = branch({}, 2);
    p.paths.push_back(waist);
    p.paths.push_back(prefix(waist, 1));
    for (int arm = 0; arm < 2; ++arm) {
      const auto path = branch(waist, 4);
      p.paths.push_back(path), p.paths.push_back(prefix(path, 4));
    }
    p.paths.push_back({}), p.paths.push_back({});
    // A hand on a thigh: what is shared of two paths is no prefix of one.
    for (int arm = 0; arm < 2; ++arm) {
      std::vector<int> both = prefix(p.paths[5 * arm], 3);
      for (int j : p.paths[12 + 2 * arm]) both.push_back(j);
      p.paths.push_back(both);
    }
  } else {
    p.base_dofs = 0;
    for (int arm = 0; arm < 2; ++arm) {
      const auto path = branch({}, 2);
      for (int k = 0; k < 3; ++k) p.paths.push_back(prefix(path, 1 + k % 2));
    }
  }
  return p;
}

/// Numbers of one lane; `least` to `most` of the slots take part. Half of the lanes start warm.
inline LaneProblem random_lane(int family, const Places& places, int least, int most, Random& rng) {
  LaneProblem p;
  p.slots.resize(places.paths.size());
  const int want = std::min(rng.integer(least, most), int(p.slots.size()));
  while (p.contacts() < want) p.slots[rng.below(int(p.slots.size()))].active = true;
  // A landing at 3 m/s, or rest.
  const bool landing = rng.below(2), warm = rng.below(2);
  for (double& x : p.x) x = (landing ? 3 : 0.03) * rng.normal();
  const double mu = rng.uniform(0.2, 1.2);

  // Rows J L^-1: of the quadruped's own factor, or like those of a body of 30 kg.
  const bool real = family == kFeet || family == kSolesOf;
  scenes::Quadruped robot(rng);
  const scenes::QuadrupedFactor factor(robot);
  for (size_t i = 0; i < p.slots.size(); ++i) {
    LaneProblem::Slot& s = p.slots[i];
    const std::vector<int>& path = places.paths[i];
    if (real) {
      const int own = family == kFeet ? 4 : 16;
      const scenes::PointRows& rows = int(i) >= own     ? robot.corners[i - own]
                                      : family == kFeet ? robot.feet[i]
                                                        : robot.soles[i / 4][i % 4];
      for (int r = 0; r < 3; ++r) {
        const scenes::QuadrupedRow y = factor.project(rows[r]);
        for (int k = 0; k < 6; ++k) s.base[k][r] = y[k];
        for (size_t k = 0; k < path.size(); ++k) s.joint[k][r] = y[6 + path[k]];
      }
    } else {
      const double at[3] = {rng.normal() * 0.3, rng.normal() * 0.3, rng.uniform(-0.9, -0.1)};
      const double rows[6][3] = {{1, 0, 0},          {0, 1, 0},          {0, 0, 1},
                                 {0, -at[2], at[1]}, {at[2], 0, -at[0]}, {-at[1], at[0], 0}};
      for (int k = 0; k < 6; ++k)
        for (int r = 0; r < 3; ++r) s.base[k][r] = rows[k][r] * (k < 3 ? 0.18 : 0.8);
      for (size_t k = 0; k < path.size(); ++k)
        for (int r = 0; r < 3; ++r) s.joint[k][r] = 0.4 * rng.normal();
    }
    s.friction = mu;
    for (int r = 0; r < 3; ++r) {
      s.free[r] = family == kArm ? 0.1 * rng.normal() : 0;
      s.impulse[r] = warm ? rng.normal() : 0;
    }
    s.free[2] += rng.below(4) ? 0 : rng.uniform(0, 0.2);
  }
  return p;
}

}  // namespace problems
