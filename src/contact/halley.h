// Slip impulse of one contact by Halley's method on a quartic, no trigonometry
// (docs/theory/contact.md (C10)-(C15)).
//
// On the boundary of the cone and the plane v_z = 0 the impulse is lambda_T = (mu a / d) e, d = 1 +
// mu w.e, with a unit vector e ([Hwangbo 2018] eq. 14). Both laws are one equation for e, with A =
// mu (a S + b w^T) and J = turn by +90 deg:
//   G(e) = (A e + b) . J (e + kappa mu w) = 0,     kappa = 0: Coulomb (eq. 6),  kappa = 1: maximum
//   dissipation (eq. 8).
// With e = ((1 - t^2) e0 + 2 t J e0) / (1 + t^2) it becomes p(t) = (1 + t^2)^2 G = q0 + q1 t + ...
// + q4 t^4. Used terms: e0 base direction; t half-angle tangent from e0; (m0, m1) = mu w in the
// basis e0, J e0; d2 = (1 + t^2) d.
//
// Where we differ from [Hwangbo 2018] Algorithm 1: the bracket of the root is known in closed form,
// so nothing is stepped; the stop is the residual velocity itself, |p| / ((1 + t^2) d2 |n|) <=
// tolerance |c|, n = e + kappa mu w, not an interval.
#pragma once
#include "contact/local.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// The quartic of one slipping contact in the basis (e0, J e0).
template <class S>
struct SlipQuartic {
  S ex, ey;  // e0
  S m0, m1;  // mu w
  S push;    // (A e0 + b) . (e0 + kappa mu w): negative where friction at e0 opposes the sliding
  S q0, q1, q2, q3, q4;
};

template <bool kMaxDissipation, class S>
STICKSLIP_INLINE SlipQuartic<S> slip_quartic(const LocalContact<S>& k, const Reduced<S>& r, S ex,
                                             S ey) {
  SlipQuartic<S> q;
  const S two = constant<S>(2);
  q.ex = ex;
  q.ey = ey;
  q.m0 = k.mu * madd(ex, k.wx, ey * k.wy);
  q.m1 = k.mu * nmadd(ey, k.wx, ex * k.wy);
  // S and b in the basis.
  const S s00 = madd(ex, madd(ex, k.sxx, ey * k.sxy), ey * madd(ex, k.sxy, ey * k.syy));
  const S s11 = k.sxx + k.syy - s00;
  const S s01 = madd(ex, madd(ex, k.sxy, ey * k.syy), -(ey * madd(ex, k.sxx, ey * k.sxy)));
  const S b0 = madd(ex, r.bx, ey * r.by), b1 = nmadd(ey, r.bx, ex * r.by);
  const S ma = k.mu * r.a;
  const S a00 = madd(ma, s00, b0 * q.m0), a01 = madd(ma, s01, b0 * q.m1);
  const S a10 = madd(ma, s01, b1 * q.m0), a11 = madd(ma, s11, b1 * q.m1);
  // G = a10-type terms; f1, f2, f0 are its cos, sin and constant parts beside the double-angle
  // ones.
  S f1 = b1, f2 = -b0, f0 = constant<S>(0);
  q.push = a00 + b0;
  if constexpr (kMaxDissipation) {
    f1 = madd(a10, q.m0, nmadd(a00, q.m1, f1));
    f2 = madd(a11, q.m0, nmadd(a01, q.m1, f2));
    f0 = nmadd(b0, q.m1, b1 * q.m0);
    q.push = madd(q.push, constant<S>(1) + q.m0, (a10 + b1) * q.m1);
  }
  const S skew = a00 - a11;
  q.q0 = a10 + f1 + f0;
  q.q1 = two * (f2 - skew);
  q.q2 = nmadd(constant<S>(4), a01, two * (f0 - a10));
  q.q3 = two * (f2 + skew);
  q.q4 = a10 - f1 + f0;
  return q;
}

/// p, p' and p'' / 2 at t.
template <class S>
struct QuarticValue {
  S p, dp, half_ddp;
};
template <class S>
STICKSLIP_INLINE QuarticValue<S> evaluate(const SlipQuartic<S>& q, S t) {
  const S two = constant<S>(2), three = constant<S>(3), t2 = t * t;
  QuarticValue<S> v;
  v.p = madd(t2, madd(t2, q.q4, madd(q.q3, t, q.q2)), madd(q.q1, t, q.q0));
  v.dp = madd(t2, madd(constant<S>(4) * q.q4, t, three * q.q3), madd(two * q.q2, t, q.q1));
  v.half_ddp = madd(t2, constant<S>(6) * q.q4, madd(three * q.q3, t, q.q2));
  return v;
}

/// Halley's step -p p' / (p'^2 - p p''/2), Newton's where the denominator is not positive;
/// NaN-free.
template <class S>
STICKSLIP_INLINE S halley_step(const QuarticValue<S>& v) {
  const S zero = constant<S>(0), square = v.dp * v.dp;
  S den = nmadd(v.p, v.half_ddp, square);
  den = select(den > zero, den, square);
  return -(v.p * v.dp) / select(den > zero, den, constant<S>(1));
}

/// The impulse on the cone at t.
template <class S>
STICKSLIP_INLINE void slip_impulse_at(const LocalContact<S>& k, const Reduced<S>& r,
                                      const SlipQuartic<S>& q, S t, S lambda[3]) {
  const S one = constant<S>(1), t2 = t * t, c2 = one - t2, s2 = t + t, o2 = one + t2;
  const S d2 = madd(q.m0, c2, madd(q.m1, s2, o2));
  // d2 > 0 on the valid arc; where it is not, the result is not used.
  const S f = r.a / select(d2 > constant<S>(0), d2, one);
  const S mf = k.mu * f;
  lambda[0] = mf * nmadd(s2, q.ey, c2 * q.ex);
  lambda[1] = mf * madd(s2, q.ex, c2 * q.ey);
  lambda[2] = f * o2;
}

/// Bracket of the root of p in t, in the basis of the stick impulse (length `norm`): p < 0 below, p
/// > 0 above.
template <bool kMaxDissipation, class S>
STICKSLIP_INLINE void slip_bracket(const LocalContact<S>& k, const Reduced<S>& r,
                                   const SlipQuartic<S>& q, S norm, Mask<S> slip, S& lo, S& hi) {
  const S zero = constant<S>(0), one = constant<S>(1);
  if constexpr (kMaxDissipation) {
    // The arc that the stick impulse sees: cos(angle) >= visible (the cone is
    // homogeneous).
    const S visible = k.mu * r.z / norm;
    const S up = max(one - visible, zero), down = one + visible;
    const auto partial = down > constant<S>(sizeof(Value<S>) == 4 ? 1e-15 : 1e-30);
    const S reach = constant<S>(sizeof(Value<S>) == 4 ? 1e8 : 1e16);
    hi = min(select(partial, sqrt(up / select(partial, down, one)), reach), reach);
    lo = -hi;
  } else {
    // e turns monotonically from e0 to S e0 / |S e0|, less than 90 degrees, as the sliding velocity
    // grows.
    const S ex = q.ex, ey = q.ey;
    const S gx = madd(ex, k.sxx, ey * k.sxy), gy = madd(ex, k.sxy, ey * k.syy);
    const S s00 = madd(ex, gx, ey * gy), s01 = nmadd(ey, gx, ex * gy);
    const S den = s00 + sqrt(madd(s00, s00, s01 * s01));
    const S end = s01 / select(den > zero, den, one);
    lo = min(zero, end);
    hi = max(zero, end);
  }
  // An unbounded conic (mu |w| > 1) ends where d = 0: cut at the roots of (1 - m0) t^2 + 2 m1 t +
  // (1 + m0).
  const S lead = one - q.m0, last = one + q.m0, disc = nmadd(lead, last, q.m1 * q.m1);
  const auto cut = slip & (disc > zero);
  if (any(cut)) {
    const S root = sqrt(max(disc, zero)), s = -(q.m1 + select(q.m1 > zero, root, -root));
    const S tiny = constant<S>(sizeof(Value<S>) == 4 ? 1e-30 : 1e-200);
    const S r1 = last / select(abs(s) > tiny, s, tiny),
            r2 = s / select(abs(lead) > tiny, lead, tiny);
    hi = select(cut & (r1 > zero) & (r1 < hi), r1, hi);
    lo = select(cut & (r1 < zero) & (r1 > lo), r1, lo);
    hi = select(cut & (r2 > zero) & (r2 < hi), r2, hi);
    lo = select(cut & (r2 < zero) & (r2 > lo), r2, lo);
  }
}

/// tan of the mean of two half-angles given by their tangents: the bisector of two directions,
/// without a tangent.
template <class S>
STICKSLIP_INLINE S bisect_angle(S lo, S hi) {
  const S one = constant<S>(1);
  const S a = sqrt(madd(lo, lo, one)), b = sqrt(madd(hi, hi, one));
  return madd(lo, b, hi * a) / (a + b);
}

/// The slipping lanes' impulses, converged: `speed` is the allowed residual velocity [m/s]. Other
/// lanes keep `lambda`.
template <bool kMaxDissipation, class S>
STICKSLIP_INLINE void solve_slip(const LocalContact<S>& k, const Reduced<S>& r, S speed,
                                 S lambda[3], int& evaluations) {
  const S zero = constant<S>(0), one = constant<S>(1);
  const S tiny = constant<S>(sizeof(Value<S>) == 4 ? 1e-30 : 1e-200);
  const S norm = sqrt(max(madd(r.x, r.x, r.y * r.y), tiny)), inv = one / norm;
  const SlipQuartic<S> q = slip_quartic<kMaxDissipation>(k, r, r.x * inv, r.y * inv);
  S lo, hi;
  slip_bracket<kMaxDissipation>(k, r, q, norm, r.slip, lo, hi);
  S t = zero;
  QuarticValue<S> v = {q.q0, q.q1, q.q2};  // p at t = 0
  Mask<S> live = r.slip & (k.mu > zero);
  constexpr int kCap = 80;
  for (int n = 1;; ++n) {
    evaluations = n;
    // Certificate: velocity along the conic. |n| by its larger component, at most 1.42 times
    // stricter.
    const S t2 = t * t, c2 = one - t2, o2 = one + t2;
    const S d2 = madd(q.m0, c2, madd(q.m1, t + t, o2));
    S length = o2;
    if constexpr (kMaxDissipation)
      length = max(abs(madd(q.m0, o2, c2)), abs(madd(q.m1, o2, t + t)));
    live = live & !(abs(v.p) <= speed * d2 * length);
    if (n == kCap || !any(live)) break;
    const auto above = v.p > zero;
    hi = select(live & above, t, hi);
    lo = select(live & !above, t, lo);
    const S next = t + halley_step(v);
    auto good = (next >= lo) & (next <= hi) & (v.dp > zero);
    // A slow tail (a step that creeps along the bracket's end) is cut short by every third
    // bisection.
    if (n > 6 && n % 3 == 0) good = none<S>();
    const auto bisect = live & !good;
    S target = next;
    if (any(bisect)) target = select(good, next, bisect_angle(lo, hi));
    // A step that no longer moves t: rounding is all that is left.
    live = live & ((target > t) | (target < t));
    t = select(live, target, t);
    v = evaluate(q, t);
  }
  S slip[3];
  slip_impulse_at(k, r, q, t, slip);
  for (int i = 0; i < 3; ++i) lambda[i] = select(r.slip, slip[i], lambda[i]);
}

/// The same out of line, for callers that seldom need it.
template <bool kMaxDissipation, class S>
__attribute__((noinline)) void solve_slip_rarely(const LocalContact<S>& k, const Reduced<S>& r,
                                                 S speed, S lambda[3]) {
  int evaluations;
  solve_slip<kMaxDissipation>(k, r, speed, lambda, evaluations);
}

/// One contact: the impulse lambda [N s] for the velocity c [m/s] that it has without it.
/// `tolerance`: residual velocity relative to |c|. `evaluations` counts those of the quartic (the
/// slowest lane's), 0 when no lane slips.
template <bool kMaxDissipation, class S>
STICKSLIP_INLINE void solve_halley(const LocalContact<S>& k, const S c[3], double tolerance,
                                   S lambda[3], int& evaluations) {
  const S zero = constant<S>(0);
  const Reduced<S> r = reduce(k, c[0], c[1], c[2]);
  // + 0: a zero has one sign, whichever way it came about.
  lambda[0] = select(r.stick, r.x, zero) + zero;
  lambda[1] = select(r.stick, r.y, zero) + zero;
  lambda[2] = select(r.stick, r.z, zero);
  evaluations = 0;
  if (any(r.slip)) {
    const S speed = constant<S>(tolerance) * sqrt(madd(c[0], c[0], madd(c[1], c[1], c[2] * c[2])));
    solve_slip<kMaxDissipation>(k, r, speed, lambda, evaluations);
  }
}

/// One visit of a sweep: a single Halley step from the direction of the contact's last slip
/// impulse, `direction` (unit; zero if there is none), which it updates. In that basis the step
/// starts at t = 0, where p, p', p'' are coefficients and the basis is known before the velocity
/// is: two divisions in a row instead of six. Where the step cannot be trusted (no direction,
/// friction that would push, a far or flat step, the pole) the lane takes the bracketed solve, to
/// `speed`.
template <bool kMaxDissipation, class S>
STICKSLIP_INLINE void visit_slip(const LocalContact<S>& k, const Reduced<S>& r, S speed,
                                 S direction[2], S lambda[3]) {
  const S zero = constant<S>(0), one = constant<S>(1), far = constant<S>(0.4);
  const S ex = direction[0], ey = direction[1];
  const SlipQuartic<S> q = slip_quartic<kMaxDissipation>(k, r, ex, ey);
  const S t = halley_step(QuarticValue<S>{q.q0, q.q1, q.q2});
  const S t2 = t * t, c2 = one - t2, s2 = t + t, o2 = one + t2;
  const S d2 = madd(q.m0, c2, madd(q.m1, s2, o2));
  const auto has = madd(ex, ex, ey * ey) > constant<S>(0.5);
  const auto good = has & (q.push < zero) & (q.q1 > zero) & (abs(t) <= far) &
                    (d2 > constant<S>(0.1)) & (one + q.m0 > constant<S>(0.1));
  const S safe = select(d2 > zero, d2, one);
  const S f = r.a / safe, mf = k.mu * f;
  const S x = nmadd(s2, ey, c2 * ex), y = madd(s2, ex, c2 * ey), inv = one / o2;
  const auto quick = r.slip & good;
  lambda[0] = select(quick, mf * x, lambda[0]);
  lambda[1] = select(quick, mf * y, lambda[1]);
  lambda[2] = select(quick, f * o2, lambda[2]);
  S dx = x * inv, dy = y * inv;
  Reduced<S> rest = r;
  rest.slip = r.slip & !good;
  if (any(rest.slip)) {
    solve_slip_rarely<kMaxDissipation>(k, rest, speed, lambda);
    const S n = sqrt(madd(lambda[0], lambda[0], lambda[1] * lambda[1])),
            on = one / select(n > zero, n, one);
    dx = select(rest.slip, lambda[0] * on, dx);
    dy = select(rest.slip, lambda[1] * on, dy);
  }
  direction[0] = select(r.slip, dx, ex);
  direction[1] = select(r.slip, dy, ey);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
