// The linear system of a Newton step: which dofs couple, and its solution.
#include <algorithm>
#include <cmath>
#include <set>

#include "check.h"
#include "contact/newton.h"
#include "contact/owned_problem.h"
#include "scenes/quadruped.h"

using namespace stickslip;
using namespace stickslip::contact;
using scenes::Random;

namespace {

using Lists = std::vector<std::vector<int>>;

/// `count` different numbers below m, ascending.
std::vector<int> some_dofs(int m, int count, Random& rng) {
  std::set<int> chosen;
  while (int(chosen.size()) < std::min(m, count)) chosen.insert(rng.below(m));
  return {chosen.begin(), chosen.end()};
}

/// A coupling that owns its memory.
struct OwnedCoupling {
  OwnedCoupling(int contacts, int dofs) {
    Arena counting(nullptr);
    coupling.lay_out(counting, contacts, dofs);
    memory.resize(counting.used() + 64);
    Arena arena(
        reinterpret_cast<char*>((reinterpret_cast<std::uintptr_t>(memory.data()) + 63) / 64 * 64));
    coupling.lay_out(arena, contacts, dofs);
  }
  void find(int m, const Lists& contacts) {
    coupling.begin(m);
    for (const auto& list : contacts) coupling.add(list.data(), int(list.size()));
    coupling.complete();
  }
  std::vector<int> list(int j) const {
    return {coupling.list(j), coupling.list(j) + coupling.count(j)};
  }
  Coupling coupling;
  std::vector<char> memory;
};

/// What couples with each dof when its turn comes, from the last to the first, pair by pair.
Lists eliminate_pairs(int m, const Lists& contacts) {
  std::vector<std::vector<bool>> pairs(m, std::vector<bool>(m));
  for (const auto& list : contacts)
    for (int a : list)
      for (int b : list) pairs[a][b] = true;
  Lists out(m);
  for (int j = m - 1; j >= 0; --j)
    for (int a = 0; a < j; ++a) {
      if (!pairs[j][a]) continue;
      out[j].push_back(a);
      for (int b = 0; b < j; ++b)
        if (pairs[j][b]) pairs[a][b] = true;
    }
  return out;
}

/// A contact of the system: rows, response and offset.
struct Part {
  bool moves = true;  // else N and g are zero
  std::vector<int> dofs;
  std::vector<std::array<double, 3>> rows;
  double n[3][3], g[3];
};

/// Sticking contacts have a symmetric response, sliding ones do not.
Part random_part(int m, bool six, Random& rng) {
  Part part;
  part.dofs = some_dofs(m, six ? 6 : 1 + rng.below(std::min(m, 14)), rng);
  for (size_t k = 0; k < part.dofs.size(); ++k)
    part.rows.push_back({rng.normal(), rng.normal(), rng.normal()});
  double half[3][3];
  const double size = std::pow(10.0, 2 * rng.uniform()), turn = rng.below(2) ? size : 0;
  for (auto& row : half)
    for (double& x : row) x = rng.normal();
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s) {
      part.n[r][s] = (s - r) * turn * 0.3;
      for (int k = 0; k < 3; ++k) part.n[r][s] += size * half[r][k] * half[s][k];
    }
  for (double& x : part.g) x = rng.normal();
  return part;
}

/// Puts the parts into the lanes of a problem: part k of every lane touches the same dofs.
template <class S>
void build(FactoredProblem<S>& p, int m, const std::vector<std::vector<Part>>& lanes) {
  p.clear(m);
  for (size_t k = 0; k < lanes[0].size(); ++k) {
    const int i = p.add();
    const std::vector<int>& dofs = lanes[0][k].dofs;
    FactoredContact<S>& c = p.contact(i);
    p.set_index(i, dofs.data(), int(dofs.size()));
    const auto gather = [&](auto&& number) {
      S out = constant<S>(0);
      for (size_t l = 0; l < lanes.size(); ++l) set_lane(out, int(l), number(lanes[l][k]));
      return out;
    };
    for (size_t d = 0; d < dofs.size(); ++d) {
      S row[3];
      for (int r = 0; r < 3; ++r) row[r] = gather([&](const Part& x) { return x.rows[d][r]; });
      c.y[d] = make_row3(row[0], row[1], row[2]);
    }
    for (int s = 0; s < 3; ++s) {
      S column[3];
      for (int r = 0; r < 3; ++r) column[r] = gather([&](const Part& x) { return x.n[r][s]; });
      c.n_columns[s] = make_row3(column[0], column[1], column[2]);
      c.n_offset[s] = gather([&](const Part& x) { return x.g[s]; });
    }
    c.moves = c.alone = false;
    for (const auto& lane : lanes) c.moves = c.alone = c.moves || lane[k].moves;
    if (ScalarTraits<S>::kWidth == 1) c.moves = c.alone = true;  // a plain scalar leaves out none
    p.complete(i);
  }
}

/// Solves it, on the path of M shared dofs (0: any number).
template <int M, class S>
const S* solve(FactoredProblem<S>& p) {
  for (int k = 0; k < p.stride(); ++k) p.scratch[k] = constant<S>(0);
  for (int i = 0; i < p.size(); ++i) {
    FactoredContact<S>& c = p.contact(i);
    transpose_rows<M>(c);
    respond<M>(c, c.n_columns);
    const S minus[3] = {-c.n_offset[0], -c.n_offset[1], -c.n_offset[2]};
    add_transposed<M>(c, minus, p.scratch);
  }
  return solve_shared<M>(p);
}

/// Gauss elimination with pivots, in long double.
std::vector<long double> solve_dense(int m, const std::vector<Part>& parts) {
  std::vector<std::vector<long double>> a(m, std::vector<long double>(m + 1));
  for (int k = 0; k < m; ++k) a[k][k] = 1;
  for (const Part& part : parts)
    for (size_t i = 0; i < part.dofs.size(); ++i)
      for (int r = 0; r < 3; ++r) {
        a[part.dofs[i]][m] -= static_cast<long double>(part.rows[i][r]) * part.g[r];
        for (size_t j = 0; j < part.dofs.size(); ++j)
          for (int s = 0; s < 3; ++s)
            a[part.dofs[i]][part.dofs[j]] +=
                static_cast<long double>(part.rows[i][r]) * part.n[r][s] * part.rows[j][s];
      }
  for (int j = 0; j < m; ++j) {
    int best = j;
    for (int i = j; i < m; ++i)
      if (std::fabs(a[i][j]) > std::fabs(a[best][j])) best = i;
    std::swap(a[j], a[best]);
    for (int i = 0; i < m; ++i)
      for (int k = m; i != j && k >= j; --k) a[i][k] -= a[i][j] / a[j][j] * a[j][k];
  }
  std::vector<long double> x(m);
  for (int k = 0; k < m; ++k) x[k] = a[k][m] / a[k][k];
  return x;
}

}  // namespace

TEST(LegsCoupleWithTheirOwnJointsAndTheBaseOnly) {
  Lists feet;
  for (int leg = 0; leg < 2; ++leg) {
    std::vector<int> foot = {0, 1, 2, 3, 4, 5};
    for (int joint = 0; joint < 6; ++joint) foot.push_back(6 + 6 * leg + joint);
    feet.push_back(foot);
  }
  OwnedCoupling found(2, 18);
  found.find(18, feet);
  for (int joint = 0; joint < 6; ++joint) {
    std::vector<int> ancestors = {0, 1, 2, 3, 4, 5};
    for (int k = 0; k < joint; ++k) ancestors.push_back(12 + k);
    CHECK(found.list(12 + joint) == ancestors);
  }
  for (int j : {17, 14, 11, 8, 5, 2}) CHECK(found.coupling.three(j));
  CHECK(!found.coupling.three(12) && !found.coupling.three(13) && !found.coupling.three(1));
}

TEST(WhateverContactsTouchTheListsAreThoseOfElimination) {
  constexpr int kMost = 140;  // beyond a word of 64 dofs too
  Random rng(1);
  OwnedCoupling found(8, kMost);
  Lists contacts;
  long filled = 0;
  for (int n = 0; n < 2000; ++n) {
    const int m = 1 + rng.below(n % 2 ? 20 : kMost);
    contacts.clear();
    for (int k = rng.below(8); k >= 0; --k) {
      const bool again = !contacts.empty() && rng.below(2);
      const Lists last(contacts.end() - again, contacts.end());
      contacts.push_back(again ? last[0] : some_dofs(m, 1 + rng.below(12), rng));
    }
    // Also where they are those of the last time, or begin like them.
    if (rng.below(4) == 0) found.find(m, {contacts.begin(), contacts.end() - 1});
    for (int times = 1 + rng.below(2); times > 0; --times) found.find(m, contacts);
    const Lists expected = eliminate_pairs(m, contacts);
    bool same = true;
    for (int j = 0; j < m; ++j) same = same && found.list(j) == expected[j];
    CHECK(same);
    for (int j = 2; j < m && same; ++j) {
      const auto follows = [&](int a) {
        std::vector<int> with = expected[a - 1];
        with.push_back(a - 1);
        return expected[a] == with;
      };
      CHECK(found.coupling.three(j) == (follows(j) && follows(j - 1)));
    }
    for (int j = 0; j < m; ++j)
      for (int k : expected[j]) {
        bool touched = false;
        for (const auto& c : contacts)
          touched = touched || (std::binary_search(c.begin(), c.end(), j) &&
                                std::binary_search(c.begin(), c.end(), k));
        filled += !touched;
      }
  }
  CHECK(filled > 10000);
}

TEST(SolutionsAreThoseOfLongDoubleAndLanesHaveTheBitsOfThePlainScalar) {
  using Wide = Pack<double, 4>;
  constexpr FactoredCapacity kCapacity{16, 80};
  Owned<double> plain(kCapacity);
  Owned<Wide> wide(kCapacity);
  Random rng(2);
  double worst = 0;
  long different = 0, other_path = 0;
  for (int n = 0; n < 1000; ++n) {
    const bool six = n % 4 == 0;
    const int m = six ? 6 : 1 + rng.below(n % 2 ? 20 : 80);
    std::vector<std::vector<Part>> lanes(4);
    for (int k = rng.below(16); k >= 0; --k) {
      // Often a run of contacts on the same dofs, as under a sole.
      const bool again = !lanes[0].empty() && rng.below(2);
      const Part part = again ? lanes[0].back() : random_part(m, six, rng);
      const int idle = rng.below(4);
      for (auto& lane : lanes) {
        Part other = random_part(m, six, rng);
        other.dofs = part.dofs;
        other.rows.resize(part.dofs.size());
        for (auto& row : other.rows) row = {rng.normal(), rng.normal(), rng.normal()};
        // In some lanes or in none.
        if (idle == 0 || (idle == 1 && rng.below(2))) {
          other.moves = false;
          for (auto& row : other.n)
            for (double& x : row) x = 0;
          for (double& x : other.g) x = 0;
        }
        lane.push_back(other);
      }
    }
    build(wide.p, m, lanes);
    const Wide* x = solve<0>(wide.p);
    for (int l = 0; l < 4; ++l) {
      build(plain.p, m, {lanes[l]});
      const double* alone = solve<0>(plain.p);
      const std::vector<long double> expected = solve_dense(m, lanes[l]);
      double size = 0;
      for (int k = 0; k < m; ++k) size = std::fmax(size, double(std::fabs(expected[k])));
      for (int k = 0; k < m; ++k) {
        worst = std::fmax(worst, std::fabs(double(alone[k] - expected[k])) / size);
        different += !(get_lane(x[k], l) == alone[k]);
      }
      if (!six) continue;
      const std::vector<double> any(alone, alone + 6);
      build(plain.p, 6, {lanes[l]});
      const double* fixed = solve<6>(plain.p);
      for (int k = 0; k < 6; ++k) different += !(fixed[k] == any[k]);
      ++other_path;
    }
    if (six) {
      std::vector<Wide> any(x, x + 6);
      build(wide.p, 6, lanes);
      const Wide* fixed = solve<6>(wide.p);
      for (int k = 0; k < 6; ++k) different += !all((fixed[k] >= any[k]) & (fixed[k] <= any[k]));
    }
  }
  std::printf("  largest error %.1e of the solution, different %ld, six dofs %ld\n", worst,
              different, other_path);
  CHECK(worst < 1e-8 && different == 0 && other_path == 1000);
}
