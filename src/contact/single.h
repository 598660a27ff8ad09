// One contact, any method: open, stick and mu = 0 are settled here, a slip goes to the chosen
// method.
#pragma once
#include "contact/bisection.h"
#include "contact/golden_section.h"
#include "contact/halley.h"
#include "contact/quartic.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Evaluations at which solve_slip gives up (halley.h).
inline constexpr int kHalleyCap = 80;

enum class Method { kHalley, kBisection, kGoldenSection, kQuartic };

/// S has rank below two, as `prepare` sees it.
STICKSLIP_INLINE bool is_singular(const LocalContact<double>& k) {
  const double eps = singular_threshold<double>(), tr = k.sxx + k.syy;
  const double det = nmadd(k.sxy, k.sxy, k.sxx * k.syy);
  return !(tr > eps * (k.xx + k.yy + k.zz) && det > eps * tr * (k.xx + k.yy));
}

/// The contact with S + 1e-11 trace(G) in place of S: a velocity error of 1e-11 |c|. A contact on a
/// rail (G of rank one) whose velocity along the normal is prescribed has to slide; with S alone it
/// has no stick impulse to start from, not even a far one.
inline LocalContact<double> regularized(LocalContact<double> k) {
  const double eps = 3e-11 * k.scale;
  k.sxx += eps, k.syy += eps;
  const double inverse = 1 / nmadd(k.sxy, k.sxy, k.sxx * k.syy);
  k.ixx = k.syy * inverse, k.ixy = -k.sxy * inverse, k.iyy = k.sxx * inverse;
  return k;
}

/// A closing contact with singular S whose pseudo-inverse does not stop it.
STICKSLIP_INLINE bool must_slide(const LocalContact<double>& k, const Reduced<double>& r,
                                 const double c[3]) {
  const double vx = madd(k.sxx, r.x, madd(k.sxy, r.y, r.bx));
  const double vy = madd(k.sxy, r.x, madd(k.syy, r.y, r.by));
  const double speed2 = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
  return (r.stick || r.slip) && vx * vx + vy * vy > 1e-20 * speed2;
}

/// A slipping contact with mu > 0 by the chosen method.
template <Method method, bool kMaxDissipation>
STICKSLIP_INLINE SlipSolution solve_slipping(const LocalContact<double>& k,
                                             const Reduced<double>& r, double tolerance) {
  if constexpr (method == Method::kHalley) {
    double lambda[3];
    int evaluations;
    solve_slip<kMaxDissipation>(k, r, tolerance, lambda, evaluations);
    return {lambda[0], lambda[1], lambda[2], evaluations, evaluations < kHalleyCap};
  } else if constexpr (method == Method::kBisection) {
    return solve_bisection(slip_problem(k, r), !kMaxDissipation, tolerance);
  } else if constexpr (method == Method::kGoldenSection) {
    static_assert(kMaxDissipation, "golden section minimizes eq. 8");
    return solve_golden_section(slip_problem(k, r), tolerance);
  } else {
    return solve_quartic<kMaxDissipation>(k, r, tolerance);
  }
}

/// What is returned where no finite impulse solves the contact, or the method found none: the
/// frictionless impulse.
inline SlipSolution frictionless(const Reduced<double>& r, int evaluations) {
  return {0, 0, r.a - r.a == 0 ? r.a : 0, evaluations, false};
}

/// The impulse [N s] of one contact whose velocity without it is c [m/s]. `evaluations` is 0 when
/// it opens or sticks. Tolerance: kHalley: residual velocity [m/s]; the others: impulse interval
/// [N s]. Always finite.
template <Method method, bool kMaxDissipation>
STICKSLIP_INLINE SlipSolution solve_single(const LocalContact<double>& given, const double c[3],
                                           double tolerance) {
  LocalContact<double> rail;
  const LocalContact<double>* used = &given;
  Reduced<double> r = reduce(given, c[0], c[1], c[2]);
  if (is_singular(given) && must_slide(given, r, c)) [[unlikely]] {
    rail = regularized(given);
    const Reduced<double> far = reduce(rail, c[0], c[1], c[2]);
    // Sticking by an impulse of 1e11 is jamming: no finite impulse solves it.
    if (!far.slip && given.mu > 0) return frictionless(r, 0);
    if (far.slip) used = &rail, r = far;
  }
  const LocalContact<double>& k = *used;
  if (!(r.stick || r.slip)) return {0, 0, 0, 0, true};
  SlipSolution s = {r.x, r.y, r.z, 0, true};
  if (!r.stick)
    s = k.mu > 0 ? solve_slipping<method, kMaxDissipation>(k, r, tolerance)
                 : SlipSolution{0, 0, r.a, 0, true};
  // Infinity or NaN: x - x is not 0.
  if (!((s.x - s.x) + (s.y - s.y) + (s.z - s.z) == 0)) [[unlikely]]
    return frictionless(r, s.evaluations);
  return s;
}

/// Calls f with the method and the law as compile-time constants: f(MethodTag<m>, LawTag<l>).
template <Method m>
struct MethodTag {
  static constexpr Method value = m;
};
template <bool kMaxDissipation>
struct LawTag {
  static constexpr bool value = kMaxDissipation;
};
template <class F>
inline void with_method(Method method, bool max_dissipation, F&& f) {
  const auto law = [&](auto tag) {
    if (max_dissipation)
      f(tag, LawTag<true>{});
    else if constexpr (decltype(tag)::value != Method::kGoldenSection)  // has no Coulomb form
      f(tag, LawTag<false>{});
  };
  switch (method) {
    case Method::kHalley:
      return law(MethodTag<Method::kHalley>{});
    case Method::kBisection:
      return law(MethodTag<Method::kBisection>{});
    case Method::kGoldenSection:
      return law(MethodTag<Method::kGoldenSection>{});
    case Method::kQuartic:
      return law(MethodTag<Method::kQuartic>{});
  }
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
