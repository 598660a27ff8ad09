// Checks of the public problem types, (C1). Every text names the argument, where it is wrong, and
// what it must be.
#include "solvers/validate.h"

#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

#include "solvers/block_system.h"
#include "solvers/dense_lu.h"
#include "solvers/explicit_view.h"
#include "solvers/large_system.h"

namespace stickslip {
namespace {

constexpr double kSmallest = 1e-40, kLargest = 1e40;  // of operators and velocities
constexpr double kAsymmetry = 1e-9;                   // of the largest entry: rounding
constexpr double kIndefinite =
    1e-6;  // of the largest diagonal entry: rounding, also of files in text

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  std::ostringstream text;
  text.precision(9);
  (text << ... << parts);
  throw ModelError(text.str());
}

void check_length(const char* name, std::size_t length, std::size_t expected, const char* shape,
                  int n) {
  if (length == expected) return;
  fail("ContactProblem.", name, " has ", length, " values; ", expected, " expected: ", shape,
       " for n = ", n, " contacts (as many as friction has)");
}

const char* method_name(SolveMethod method) {
  switch (method) {
    case SolveMethod::kPgs:
      return "pgs";
    case SolveMethod::kProxNewton:
      return "prox_newton";
    case SolveMethod::kInteriorPoint:
      return "interior_point";
    case SolveMethod::kAdmm:
      return "admm";
    case SolveMethod::kPerContact:
      return "per_contact";
    default:
      return "auto";
  }
}

void check_diagonal(int row, double x) {
  if (x < 0)
    fail("ContactProblem.delassus[", row, ", ", row, "] is ", x,
         " 1/kg; the diagonal of J M^-1 J^T is never negative");
}

void check_pair(int row, int column, double a, double b, double allowed) {
  const double apart = std::fabs(a - b);
  if (apart > allowed)
    fail("ContactProblem.delassus is not symmetric: [", row, ", ", column, "] and [", column, ", ",
         row, "] differ by ", apart, " 1/kg; at most ", kAsymmetry,
         " of the largest entry is taken for rounding (use (G + G.T) / 2 if it is)");
}

[[noreturn]] void fail_not_finite(int row, int column, double x) {
  fail("ContactProblem.delassus[", row, ", ", column, "] is ", x, "; every entry must be finite");
}

/// Every entry finite, no negative diagonal, both triangles equal but for rounding. Problems of
/// robot size are checked in every solve, so the loops are plain sums and maxima; only a fault
/// looks for its place.
void check_dense(const std::vector<double>& G, int m) {
  constexpr int kLanes = 4;
  double sums[kLanes] = {}, most[kLanes] = {};
  const std::size_t size = G.size(), whole = size / kLanes * kLanes;
  const double* g = G.data();
  for (std::size_t i = 0; i < whole; i += kLanes)
    for (int k = 0; k < kLanes; ++k) {
      sums[k] += g[i + k] - g[i + k];  // NaN from NaN and infinity
      most[k] = max(most[k], abs(g[i + k]));
    }
  for (std::size_t i = whole; i < size; ++i) {
    sums[0] += g[i] - g[i];
    most[0] = max(most[0], abs(g[i]));
  }
  if (!(sums[0] + sums[1] + sums[2] + sums[3] == 0))
    for (std::size_t i = 0; i < size; ++i)
      if (!std::isfinite(g[i])) fail_not_finite(int(i / m), int(i % m), g[i]);
  const double allowed = kAsymmetry * max(max(most[0], most[1]), max(most[2], most[3]));
  bool fine = true;
  for (int i = 0; i < m; ++i) {
    const double* row = g + std::size_t(i) * m;
    fine = fine & (row[i] >= 0);
    for (int j = 0; j < i; ++j) fine = fine & (abs(row[j] - g[std::size_t(j) * m + i]) <= allowed);
  }
  if (fine) return;
  for (int i = 0; i < m; ++i) {
    check_diagonal(i, g[std::size_t(i) * m + i]);
    for (int j = 0; j < i; ++j)
      check_pair(i, j, g[std::size_t(i) * m + j], g[std::size_t(j) * m + i], allowed);
  }
}

/// Indices first: everything after relies on them.
void check_blocks(const ContactProblem& p, int n) {
  const auto& starts = p.block_starts;
  check_length("block_starts", starts.size(), std::size_t(n) + 1, "(n + 1)", n);
  const std::size_t blocks = p.block_columns.size();
  if (starts[0] != 0 || starts[n] < 0 || std::size_t(starts[n]) != blocks)
    fail("ContactProblem.block_starts runs from ", starts[0], " to ", starts[n],
         "; it must run from 0 to ", blocks, ", the number of block_columns");
  for (int i = 0; i < n; ++i)
    if (starts[i] > starts[i + 1])
      fail("ContactProblem.block_starts[", i + 1, "] is ", starts[i + 1],
           ", less than the one before, ", starts[i]);
  for (int i = 0; i < n; ++i) {
    bool diagonal = false;
    for (int k = starts[i]; k < starts[i + 1]; ++k) {
      const int j = p.block_columns[k];
      if (j < 0 || j >= n)
        fail("ContactProblem.block_columns[", k, "] is ", j, "; it must lie in [0, ", n, ")");
      if (k > starts[i] && j <= p.block_columns[k - 1])
        fail("ContactProblem.block_columns[", k, "] is ", j, " after ", p.block_columns[k - 1],
             "; columns must ascend within a row of blocks");
      diagonal = diagonal || j == i;
    }
    if (!diagonal)
      fail("ContactProblem: row ", i,
           " of blocks has no diagonal block; store it even where it is zero");
  }
  if (p.delassus.size() != 9 * blocks)
    fail("ContactProblem.delassus has ", p.delassus.size(), " values; ", 9 * blocks,
         " expected: (k, 3, 3) for k = ", blocks, " block_columns");
}

/// The block of row i and column j, or null.
const double* block_at(const ContactProblem& p, int i, int j) {
  const auto first = p.block_columns.begin() + p.block_starts[i],
             last = p.block_columns.begin() + p.block_starts[i + 1];
  const auto found = std::lower_bound(first, last, j);
  if (found == last || *found != j) return nullptr;
  return p.delassus.data() + 9 * (found - p.block_columns.begin());
}

void check_block_sparse(const ContactProblem& p, int n) {
  check_blocks(p, n);
  double largest = 0;
  for (int i = 0; i < n; ++i)
    for (int k = p.block_starts[i]; k < p.block_starts[i + 1]; ++k)
      for (int e = 0; e < 9; ++e) {
        const double x = p.delassus[9 * std::size_t(k) + e];
        if (!std::isfinite(x)) fail_not_finite(3 * i + e / 3, 3 * p.block_columns[k] + e % 3, x);
        largest = std::max(largest, std::fabs(x));
      }
  for (int i = 0; i < n; ++i)
    for (int k = p.block_starts[i]; k < p.block_starts[i + 1]; ++k) {
      const int j = p.block_columns[k];
      const double *block = p.delassus.data() + 9 * std::size_t(k), *other = block_at(p, j, i);
      for (int e = 0; e < 9; ++e)
        check_pair(3 * i + e / 3, 3 * j + e % 3, block[e], other ? other[3 * (e % 3) + e / 3] : 0,
                   kAsymmetry * largest);
      for (int r = 0; r < 3 && i == j; ++r) check_diagonal(3 * i + r, block[4 * r]);
    }
}

/// Cholesky of G + shift, on the upper triangle, for problems of robot size. The first row without
/// a positive pivot, or -1.
int first_bad_pivot(const std::vector<double>& G, int m, double shift) {
  using solvers::kRowChunk;
  using Chunk = Pack<double, kRowChunk>;
  const int stride = solvers::padded_row(m);
  std::vector<double> u(std::size_t(m) * stride);
  for (int i = 0; i < m; ++i)
    std::copy_n(G.data() + std::size_t(i) * m, m, u.data() + std::size_t(i) * stride);
  for (int j = 0; j < m; ++j) {
    const double* top = u.data() + std::size_t(j) * stride;
    const double pivot = top[j] + shift;
    if (!(pivot > 0)) return j;
    const double inverse = -1 / pivot;
    for (int i = j + 1; i < m; ++i) {
      const Chunk f(top[i] * inverse);
      double* row = u.data() + std::size_t(i) * stride;
      // Whole chunks: what lies left of the diagonal is not used.
      for (int k = i / kRowChunk * kRowChunk; k < m; k += kRowChunk)
        solvers::store_row(row + k,
                           madd(f, solvers::load_row(top + k), solvers::load_row(row + k)));
    }
  }
  return -1;
}

/// Squares of velocities and impulses must neither overflow nor vanish.
void check_range(const char* what, const char* unit, double largest) {
  if (largest == 0 || (largest >= kSmallest && largest <= kLargest)) return;
  fail("ContactProblem.", what, " has a largest entry of ", largest, " ", unit,
       "; it must be 0 or lie in [", kSmallest, ", ", kLargest, "] (choose other units)");
}

/// J M^-1 J^T has no negative eigenvalue; one of at most kIndefinite of the largest diagonal entry
/// is taken for rounding.
void check_semidefinite(const ContactProblem& p, int n) {
  if (n == 0) return;
  double largest = 0;
  for (int i = 0; i < n; ++i) {
    const double* block = p.is_block_sparse() ? block_at(p, i, i) : nullptr;
    for (std::size_t r = 0; r < 3; ++r) {
      const std::size_t at = 3 * std::size_t(i) + r;
      largest = std::max(largest, block ? block[4 * r] : p.delassus[at * 3 * n + at]);
    }
  }
  check_range("delassus", "1/kg", largest);
  // Shifted by a zero matrix's own size: a zero diagonal allows no other entry.
  const double shift = largest > 0 ? kIndefinite * largest : 1e-300;
  const char* reason = " of the largest diagonal entry; J M^-1 J^T is positive semidefinite";
  if (!p.is_block_sparse() && n <= solvers::BlockSystem::kDenseRows / 3) {
    if (const int row = first_bad_pivot(p.delassus, 3 * n, shift); row >= 0)
      fail("ContactProblem.delassus is indefinite: rows and columns 0 to ", row,
           " have an eigenvalue below ", -shift, " 1/kg, that is -", kIndefinite, reason);
  } else if (!solvers::is_definite(solvers::ExplicitView(p, {}).view, shift)) {
    fail("ContactProblem.delassus is indefinite: it has an eigenvalue below ", -shift,
         " 1/kg, that is -", kIndefinite, reason);
  }
}

}  // namespace

namespace solvers {

void check_impulse(const char* name, const std::vector<double>& impulse, int n) {
  if (impulse.size() != 3 * static_cast<std::size_t>(n))
    fail(name, " has ", impulse.size(), " values; ", 3 * n, " expected: x, y, z of ", n,
         " contacts");
  for (std::size_t i = 0; i < impulse.size(); ++i)
    if (!std::isfinite(impulse[i]))
      fail(name, "[", i, "] is ", impulse[i], "; every entry must be finite");
}

void check_single(SingleContactMethod method, FrictionLaw law, const char* where) {
  if (method == SingleContactMethod::kGoldenSection && law == FrictionLaw::kCoulomb)
    fail(where,
         ": golden_section minimizes the energy of eq. 8 and has no form for law coulomb; use law "
         "max_dissipation, or halley, bisection or quartic");
}

void check_settings(const char* where, const SolverSettings& s) {
  if (!(s.tolerance >= 0) || std::isinf(s.tolerance))
    fail(where, ".tolerance is ", s.tolerance, "; it must be zero or positive [m/s]");
  if (!(s.relative_tolerance >= 0) || std::isinf(s.relative_tolerance))
    fail(where, ".relative_tolerance is ", s.relative_tolerance, "; it must be zero or positive");
  if (s.tolerance == 0 && s.relative_tolerance == 0)
    fail(where, ".tolerance is 0 and so is relative_tolerance; one of them must be positive");
  if (s.max_sweeps < 1) fail(where, ".max_sweeps is ", s.max_sweeps, "; it must be at least 1");
  if (!(s.alpha > 0 && s.alpha <= 2)) fail(where, ".alpha is ", s.alpha, "; it must lie in (0, 2]");
  if (!(s.alpha_min > 0 && s.alpha_min <= 2))
    fail(where, ".alpha_min is ", s.alpha_min, "; it must lie in (0, 2]");
  if (!(s.gamma >= 0 && s.gamma <= 1))
    fail(where, ".gamma is ", s.gamma, "; it must lie in [0, 1]");
  if (s.method != SolveMethod::kAuto && s.method != SolveMethod::kPerContact &&
      s.law != FrictionLaw::kCoulomb)
    fail(where, ": ", method_name(s.method),
         " solves law coulomb only (eq. 6); use per_contact or auto for max_dissipation");
  if (s.method == SolveMethod::kPerContact)
    check_single(s.single_contact, s.law, (std::string(where) + ".single_contact").c_str());
}

}  // namespace solvers

void ContactProblem::validate() const {
  const std::size_t n = friction.size();
  if (is_block_sparse()) {
    check_block_sparse(*this, int(n));
  } else {
    check_length("delassus", delassus.size(), 9 * n * n, "(3n, 3n)", int(n));
    check_dense(delassus, int(3 * n));
  }
  check_length("free_velocity", free_velocity.size(), 3 * n, "(3n)", int(n));
  double fastest = 0;
  for (std::size_t i = 0; i < 3 * n; ++i) {
    if (!std::isfinite(free_velocity[i]))
      fail("ContactProblem.free_velocity[", i, "] is ", free_velocity[i],
           "; every entry must be finite");
    fastest = max(fastest, abs(free_velocity[i]));
  }
  check_range("free_velocity", "m/s", fastest);
  for (std::size_t i = 0; i < n; ++i) {
    if (std::isnan(friction[i]))
      fail("ContactProblem.friction[", i, "] is nan; it must be zero or positive");
    if (friction[i] < 0)
      fail("ContactProblem.friction[", i, "] is ", friction[i], "; it must be zero or positive");
  }
  check_semidefinite(*this, int(n));
}

void SolveOptions::validate() const {
  solvers::check_settings("SolveOptions", solvers::settings_of(*this));
  if (max_iterations < 0)
    fail("SolveOptions.max_iterations is ", max_iterations, "; it must be zero or positive");
  if (!(proximal_weight > 0) || std::isinf(proximal_weight))
    fail("SolveOptions.proximal_weight is ", proximal_weight, "; it must be positive");
  if (!(single_contact_tolerance >= 0) || std::isinf(single_contact_tolerance))
    fail("SolveOptions.single_contact_tolerance is ", single_contact_tolerance,
         "; it must be zero or positive [N s]");
  if (law == FrictionLaw::kMaxDissipation && minimum_norm)
    fail("SolveOptions.minimum_norm is for law coulomb only");
}

}  // namespace stickslip
