// Checks of the public problem types. Every text names the argument, where it is wrong, and what it
// must be.
#include "contact/validate.h"

#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include <cmath>
#include <sstream>
#include <string>

#include "contact/dense_factor.h"

namespace stickslip {
namespace {

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

void check_delassus(const std::vector<double>& G, std::size_t m) {
  double largest = 0;
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < m; ++j) {
      const double x = G[i * m + j];
      if (!std::isfinite(x))
        fail("ContactProblem.delassus[", i, ", ", j, "] is ", x, "; every entry must be finite");
      largest = std::fmax(largest, std::fabs(x));
    }
  for (std::size_t i = 0; i < m; ++i)
    if (G[i * m + i] < 0)
      fail("ContactProblem.delassus[", i, ", ", i, "] is ", G[i * m + i],
           " 1/kg; the diagonal of J M^-1 J^T is never negative");
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double apart = std::fabs(G[i * m + j] - G[j * m + i]);
      if (apart > 1e-9 * largest)
        fail("ContactProblem.delassus is not symmetric: [", i, ", ", j, "] and [", j, ", ", i,
             "] differ by ", apart,
             " 1/kg; at most 1e-9 of the largest entry is taken for rounding (use (G + G.T) / 2 if "
             "it is)");
    }
}

}  // namespace

namespace contact {

DenseFactor validated_factor(const ContactProblem& p) {
  const std::size_t n = p.friction.size();
  check_length("delassus", p.delassus.size(), 9 * n * n, "(3n, 3n)", int(n));
  check_length("free_velocity", p.free_velocity.size(), 3 * n, "(3n)", int(n));
  check_delassus(p.delassus, 3 * n);
  for (std::size_t i = 0; i < 3 * n; ++i)
    if (!std::isfinite(p.free_velocity[i]))
      fail("ContactProblem.free_velocity[", i, "] is ", p.free_velocity[i],
           "; every entry must be finite");
  for (std::size_t i = 0; i < n; ++i) {
    if (std::isnan(p.friction[i]))
      fail("ContactProblem.friction[", i, "] is nan; it must be zero or positive");
    if (p.friction[i] < 0)
      fail("ContactProblem.friction[", i, "] is ", p.friction[i], "; it must be zero or positive");
  }
  DenseFactor f = factor_dense(p.delassus.data(), int(3 * n));
  if (f.worst >= 0)
    fail("ContactProblem.delassus is indefinite: eliminating row ", f.worst, " leaves a part of ",
         f.negative,
         " of the largest diagonal entry that no positive semidefinite matrix has; J M^-1 J^T is "
         "semidefinite");
  return f;
}

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
  if (!(s.tolerance > 0) || std::isinf(s.tolerance))
    fail(where, ".tolerance is ", s.tolerance, "; it must be positive [m/s]");
  if (s.max_sweeps < 1) fail(where, ".max_sweeps is ", s.max_sweeps, "; it must be at least 1");
  if (!(s.alpha > 0 && s.alpha <= 2)) fail(where, ".alpha is ", s.alpha, "; it must lie in (0, 2]");
  if (!(s.alpha_min > 0 && s.alpha_min <= 2))
    fail(where, ".alpha_min is ", s.alpha_min, "; it must lie in (0, 2]");
  if (!(s.gamma >= 0 && s.gamma <= 1))
    fail(where, ".gamma is ", s.gamma, "; it must lie in [0, 1]");
  if (s.method == SolveMethod::kPgs && s.law != FrictionLaw::kCoulomb)
    fail(where,
         ": pgs solves law coulomb only (eq. 6); use per_contact or auto for max_dissipation");
  if (s.method == SolveMethod::kPerContact)
    check_single(s.single_contact, s.law, (std::string(where) + ".single_contact").c_str());
}

}  // namespace contact

void ContactProblem::validate() const { contact::validated_factor(*this); }

void SolveOptions::validate() const {
  contact::check_settings("SolveOptions", contact::settings_of(*this));
  if (!(single_contact_tolerance >= 0) || std::isinf(single_contact_tolerance))
    fail("SolveOptions.single_contact_tolerance is ", single_contact_tolerance,
         "; it must be zero or positive [N s]");
}

}  // namespace stickslip
