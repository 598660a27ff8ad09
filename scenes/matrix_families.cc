// Families made by linear algebra: contacts several times, matrices of any condition.
#include <algorithm>
#include <cmath>

#include "scenes/problem_families.h"
#include "scenes/problem_options.h"

namespace stickslip::scenes {

ContactProblem duplicate(const ContactProblem& p, int copies) {
  check_range("copies", copies, 1, 16);
  const int n = copies * p.num_contacts(), m = 3 * p.num_contacts();
  ContactProblem d;
  std::vector<int> row;  // of p, for each row of d
  for (int i = 0; i < n; ++i) {
    d.friction.push_back(p.friction[i / copies]);
    for (int r = 0; r < 3; ++r) row.push_back(3 * (i / copies) + r);
  }
  for (const int a : row) {
    d.free_velocity.push_back(p.free_velocity[a]);
    for (const int b : row) d.delassus.push_back(p.delassus[a * m + b]);
  }
  return d;
}

ContactProblem duplicated_contacts(std::uint64_t seed, const DuplicatedOptions& o) {
  check_range("copies", o.copies, 2, 16);
  check_friction(o.friction);
  constexpr QuadrupedScene kScenes[] = {kStand, kTrot, kImpact, kRestEight, kDropEight};
  Random rng(~seed);  // not the numbers that the base is drawn from
  const auto drawn_base = static_cast<DuplicatedBase>(rng.below(6)),
             base = o.base.value_or(drawn_base);
  const int drawn_copies = rng.below(2) ? 4 : 2, copies = o.copies.value_or(drawn_copies);
  if (base != DuplicatedBase::kBoxStack)
    return duplicate(quadruped(kScenes[static_cast<int>(base)], seed, {o.friction}), copies);
  BoxStackOptions stack;
  stack.friction = o.friction;
  return duplicate(box_stack(seed, stack), copies);
}

namespace {

using Vector = std::vector<double>;

/// Takes the parts along `others` away from a vector and gives it length 1. Twice: once leaves
/// parts of the size of what cancels.
void make_orthonormal(Vector& v, const std::vector<Vector>& others) {
  const auto product = [&v](const Vector& a) {
    double sum = 0;
    for (std::size_t k = 0; k < v.size(); ++k) sum += a[k] * v[k];
    return sum;
  };
  for (int pass = 0; pass < 2; ++pass) {
    for (const Vector& other : others) {
      const double along = product(other);
      for (std::size_t k = 0; k < v.size(); ++k) v[k] -= along * other[k];
    }
    const double length = std::sqrt(product(v));
    for (double& x : v) x /= length;
  }
}

/// `count` orthonormal vectors of dimension `size`, random but for the first, which has the
/// direction of `first` where that is given.
std::vector<Vector> random_basis(int count, int size, Random& rng, const Vector& first = {}) {
  std::vector<Vector> basis;
  for (int j = 0; j < count; ++j) {
    Vector v(size);
    for (double& x : v) x = rng.normal();
    if (j == 0 && !first.empty()) v = first;
    make_orthonormal(v, basis);
    basis.push_back(v);
  }
  return basis;
}

}  // namespace

ContactProblem ill_conditioned(std::uint64_t seed, const IllConditionedOptions& o) {
  check_range("num_contacts", o.num_contacts, 1, 100);
  check_range("condition", o.condition, 1.0, 1e12);
  check_friction(o.friction);
  Random rng(seed);
  const int drawn_contacts = rng.integer(2, 8), n = o.num_contacts.value_or(drawn_contacts);
  const int m = 3 * n;
  check_range("rank", o.rank, 1, m);
  const double drawn_condition = rng.log_uniform(1, 1e12),
               condition = o.condition.value_or(drawn_condition);
  const int drawn_rank = rng.integer((m + 1) / 2, m), rank = o.rank.value_or(drawn_rank);
  const double friction = draw_friction(o.friction, rng);
  // The range holds a motion that lifts all contacts; no eigenvector is that motion.
  Vector lift(m);
  for (int i = 0; i < n; ++i) lift[3 * i + 2] = 1;
  const auto range = random_basis(rank, m, rng, lift), turn = random_basis(rank, rank, rng);
  std::vector<Vector> y(rank, Vector(m));  // columns of Y
  for (int k = 0; k < rank; ++k) {
    const double eigenvalue = k == 0          ? 1
                              : k == rank - 1 ? 1 / condition
                                              : rng.log_uniform(1 / condition, 1);
    for (int l = 0; l < rank; ++l)
      for (int a = 0; a < m; ++a) y[k][a] += std::sqrt(eigenvalue) * turn[k][l] * range[l][a];
  }
  ContactProblem p;
  p.delassus.resize(m * m), p.free_velocity.resize(m), p.friction.assign(n, friction);
  for (const Vector& column : y) {
    const double x = rng.normal();
    for (int a = 0; a < m; ++a) {
      p.free_velocity[a] += column[a] * x;
      for (int b = 0; b < m; ++b) p.delassus[a * m + b] += column[a] * column[b];
    }
  }
  return p;
}

}  // namespace stickslip::scenes
