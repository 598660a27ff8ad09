// The default solver of a step, `auto`: warm-started sweeps, Newton finish on the shared dofs,
// fallback, certificate (docs/theory/solvers.md (C20)-(C38)). Never fails to return: the best
// impulse found, its residual, and whether it is good enough.
//
// Rule between sweeps and Newton steps, per lane: with e_k the largest velocity change of sweep k,
// e_k^2 / e_(k-1) is what the next one is expected to change. Where that is above the tolerance
// after every third sweep, or each late one, a Newton step comes next. Where the certificate then,
// Newton step or not, finds well below the allowed residual the lane is done. Else it is swept
// again. Or, with `foresee`, if no Newton step lay between the last two sweeps, not at all: the
// lane stops, and goes on only if the certificate says that it should have. Every third: a step
// costs several sweeps, and lanes of a pack take it, and end, together. Maximum dissipation
// ([Hwangbo 2018] eq. 8) is not a complementarity problem in the velocity, so the Newton finish and
// the fallback do not apply: it sweeps to the end, and its residual is
// |G_ii (lambda_i - local_i)|.
#pragma once
#include "contact/jam.h"
#include "contact/newton_bodies.h"
#include "contact/one_lane.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

struct FactoredOptions {
  bool max_dissipation = false;
  double tolerance_absolute = 1e-9;  ///< stop: velocity change of a sweep [m/s] ...
  double tolerance_relative = 1e-8;  ///< ... plus this much of the largest free contact velocity
  double residual_tolerance = 1e-8;  ///< converged: largest residual at most this [m/s]
  double alpha = 3e-8;               ///< proximal weight of Newton steps ...
  double alpha_late = 1e-4;          ///< ... and of late ones
  int late = 9;                      ///< from this sweep on, a step after each
  double enough = 1e-3;  ///< done: residual where the certificate is asked, in terms of the allowed
  int max_sweeps = 24;   ///< before the fallback
  int max_dissipation_sweeps = 1600;
  /// Leaves out a sweep that is expected to change less than the tolerance. For tolerances that the
  /// certificate can vouch for, with residual_tolerance.
  bool foresee = true;
  bool fallback = true;
};

/// Options that suit the precision of S.
template <class S>
FactoredOptions default_options() {
  FactoredOptions o;
  if (sizeof(Value<S>) == 4) {
    o.tolerance_absolute = 1e-6;
    o.tolerance_relative = 1e-5;
    o.residual_tolerance = 1e-5;
    // It doubles the share of a humanoid's steps that double judges above 1e-5 m/s.
    o.foresee = false;
    // With less weight, Newton steps chase the rounding of redundant contacts; with more, they
    // creep where robots hang and slide. What is not solved after 24 sweeps seldom is (measured on
    // the tasks of benchmarks/compare and benchmarks/micro/lane_kernels.cc).
    o.alpha = 3e-4;
    o.alpha_late = 5e-3;
    o.enough = 0.1;
  }
  return o;
}

template <class S>
struct FactoredInfo {
  S residual;         // largest of the contacts [m/s]
  Mask<S> converged;  // residual within tolerance; false where an input is not finite (then the
                      // impulses are zero)
  int sweeps = 0;     // passes over all contacts
  int newton_steps = 0;
  int resumed = 0;    // solves that went on after a sweep was left out in vain
  int fallbacks = 0;  // lanes that needed it
  int fallback_steps = 0;
};

/// |G_ii (lambda_i - local_i)|^2 [m^2/s^2]: what is left where the sliding law is maximum
/// dissipation.
template <class S>
STICKSLIP_INLINE S fixed_point_residual_squared(const LocalContact<S>& k, const S v[3],
                                                const S l[3]) {
  S free[3], best[3], d[3];
  int evaluations;
  apply_block(k, l, free);
  for (int r = 0; r < 3; ++r) free[r] = v[r] - free[r];
  solve_halley<true>(k, free, sizeof(Value<S>) == 4 ? 1e-6 : 1e-13, best, evaluations);
  for (int r = 0; r < 3; ++r) best[r] = l[r] - best[r];
  apply_block(k, best, d);
  return madd(d[0], d[0], madd(d[1], d[1], d[2] * d[2]));
}

/// Largest residual of the contacts, plus the most that the rounding of an impulse hides [m/s], so
/// that there is one root for all; writes their velocities. Four contacts at a time for a plain
/// scalar.
template <int M, bool kMaxDissipation, class S>
STICKSLIP_STAGE S certify(FactoredProblem<S>& p) {
  constexpr int kLanes = kMaxDissipation ? 1 : kChunk<S>;
  using T = typename ChunkOf<S, kLanes != 1>::Type;
  const int n = p.size();
  // The second: NaN once a residual is not finite.
  T worst_squared = constant<T>(0), spoiled = constant<T>(0), rounding = constant<T>(0);
  for (int first = 0; first < n; first += kLanes) {
    LocalContact<T> k;
    T v[3], l[3];
    for (int j = 0; j < kLanes; ++j) {
      FactoredContact<S>& c = p.contact(first + j < n ? first + j : first);
      S impulse[3];
      contact_velocity<M>(c, p.w, c.velocity);
      store(c.lambda, impulse);
      const auto put = [j](T& to, S x) { reinterpret_cast<S*>(&to)[j] = x; };
      for (int r = 0; r < 3; ++r) put(v[r], c.velocity[r]), put(l[r], impulse[r]);
      if constexpr (kMaxDissipation) {
        k = c.local;
      } else {
        put(k.scale, c.local.scale);
        put(k.mu, c.local.mu);
      }
    }
    T square;
    if constexpr (kMaxDissipation)
      square = fixed_point_residual_squared(k, v, l);
    else
      square = natural_map_residual_squared(k, v, l);
    worst_squared = max(worst_squared, square);
    rounding = max(rounding, impulse_rounding(k, l));
    spoiled = madd(constant<T>(0), square, spoiled);
  }
  if constexpr (kLanes == 1) {
    return sqrt(worst_squared) + rounding + spoiled;
  } else {
    S most = get_lane(worst_squared, 0), hidden = get_lane(rounding, 0), all = get_lane(spoiled, 0);
    for (int j = 1; j < kLanes; ++j) {
      most = max(most, get_lane(worst_squared, j));
      hidden = max(hidden, get_lane(rounding, j));
      all = all + get_lane(spoiled, j);
    }
    return sqrt(most) + hidden + all;
  }
}

/// One guarded Newton step on the lanes `live`, by bodies where the problem has some.
template <int M, class S>
STICKSLIP_INLINE void any_newton_step(FactoredProblem<S>& p, Mask<S> live, S alpha) {
  if (M == 0 && p.num_bodies() > 0)
    newton_step_by_bodies(p, live, alpha);
  else
    newton_step<M>(p, live, alpha);
}

/// How sweeps and Newton steps ended.
template <class S>
struct Outcome {
  Mask<S> foreseen;        // lanes that left out a sweep
  bool certified = false;  // the certificate came last, so that
  S residual;              // is that of the impulses [m/s]
};

/// Sweeps and Newton steps until in every lane of `live` the change is small, or the residual is at
/// most `enough` where the certificate is asked, or, with `foresee`, the next sweep is expected to
/// change little; or the cap.
template <int M, bool kMaxDissipation, class S>
STICKSLIP_STAGE Outcome<S> iterate(FactoredProblem<S>& p, Mask<S> live, S tolerance_squared,
                                   bool foresee, const FactoredOptions& o, FactoredInfo<S>& info) {
  constexpr int kEvery = 3;
  Outcome<S> out;
  const S tolerance = sqrt(tolerance_squared), speed = constant<S>(0.1) * tolerance;
  const S enough = min(constant<S>(o.enough * o.residual_tolerance), tolerance);
  S before = constant<S>(1e30);
  Mask<S> only_swept = live;
  out.foreseen = none<S>();
  const int cap = kMaxDissipation ? o.max_dissipation_sweeps : o.max_sweeps;
  for (int k = 1;; ++k) {
    const S change = sweep<M, kMaxDissipation>(p, live, speed);
    out.certified = false;
    ++info.sweeps;
    live = live & (change > tolerance_squared);
    const auto slow = live & (change * change > tolerance_squared * before);
    if (!kMaxDissipation && foresee && k >= 2) {
      const auto stops = live & only_swept & !slow;
      out.foreseen = out.foreseen | stops;
      live = live & !stops;
    }
    if (!any(live) || k >= cap) return out;
    only_swept = live;
    before = change;
    const bool late = k >= o.late;
    if (kMaxDissipation || !(late || k % kEvery == 0)) continue;
    if (any(slow)) {
      any_newton_step<M>(p, slow, constant<S>(late ? o.alpha_late : o.alpha));
      ++info.newton_steps;
      only_swept = !slow;
    }
    out.residual = certify<M, kMaxDissipation>(p);
    out.certified = true;
    live = live & !(out.residual <= enough);
    if (!any(live)) return out;
  }
}

template <int M>
void prepare_contacts(FactoredProblem<double>& p) {
  for (int i = 0; i < p.size(); ++i) {
    p.complete(i);
    prepare_contact<M>(p.contact(i));
  }
}

/// Calls f(problem, lane) with each of the lanes as a prepared problem in double, and takes the
/// impulses and w that it leaves (`lambda` and w are those of p).
template <int M, class S, class F>
void improve_lanes(FactoredProblem<S>& p, Mask<S> lanes, F&& f) {
  for (int i = 0; i < p.size(); ++i) store(p.contact(i).lambda, p.contact(i).impulse);
  solve_lanes(p, lanes, [&](FactoredProblem<double>& q, int lane) {
    prepare_contacts<M>(q);  // also where it is p itself: the same bits either way
    f(q, lane);
    for (int i = 0; i < q.size(); ++i) store(q.contact(i).lambda, q.contact(i).impulse);
  });
  for (int i = 0; i < p.size(); ++i) set_impulse(p.contact(i), p.contact(i).impulse);
}

/// The residuals of these lanes' impulses, evaluated in double; nothing of p changes. In float the
/// evaluation itself errs by more than the tolerance where points are fast.
template <int M, class S>
__attribute__((noinline)) S certify_in_double(FactoredProblem<S>& p, Mask<S> lanes) {
  S worst = constant<S>(0);
  for (int i = 0; i < p.size(); ++i) store(p.contact(i).lambda, p.contact(i).impulse);
  for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane) {
    if (!get_lane(lanes, lane)) continue;
    FactoredProblem<double>& q = *p.lane;
    extract_lane(p, lane, q);
    prepare_contacts<M>(q);
    accumulate<M>(q);
    set_lane(worst, lane, Value<S>(certify<M, false>(q)));
  }
  return worst;
}

template <int M, class S>
__attribute__((noinline)) void run_fallback(FactoredProblem<S>& p, Mask<S> lanes, S tolerance,
                                            FactoredInfo<S>& info) {
  improve_lanes<M>(p, lanes, [&](FactoredProblem<double>& q, int lane) {
    ++info.fallbacks;
    Fallback<M> fallback(q, double(get_lane(tolerance, lane)));
    fallback.run();
    info.fallback_steps += fallback.steps();
  });
}

/// Of the lanes that are not solved, those that jam get a bounded answer that does not sink
/// (jam.h). False if there are none.
template <int M, bool kMaxDissipation, class S>
__attribute__((noinline)) bool release_jams(FactoredProblem<S>& p, Mask<S> bad, S fastest,
                                            S allowed) {
  const JamLimits<S> limits = jam_limits(fastest, allowed);
  const auto jammed = bad & jammed_lanes(p, limits);
  if (!any(jammed)) return false;
  improve_lanes<M>(p, jammed, [&](FactoredProblem<double>& q, int lane) {
    const JamLimits<double> one = {double(get_lane(limits.impulse, lane)),
                                   double(get_lane(limits.sinking, lane))};
    JamRelease<M, kMaxDissipation>(q, one, double(get_lane(allowed, lane))).run();
  });
  return true;
}

template <int M, bool kMaxDissipation, class S>
void solve_factored_as(FactoredProblem<S>& p, const FactoredOptions& o, FactoredInfo<S>& info) {
  const S zero = constant<S>(0);
  S fastest = zero, sum = zero;
  for (int i = 0; i < p.size(); ++i) {
    FactoredContact<S>& c = p.contact(i);
    p.complete(i);
    prepare_contact<M>(c);
    S v[3];
    store(add_rows<M>(c, p.w0, make_row3(c.offset[0], c.offset[1], c.offset[2])), v);
    const S square = madd(v[0], v[0], madd(v[1], v[1], v[2] * v[2]));
    fastest = max(fastest, select(c.active, square, zero));
    sum = sum + (square + c.local.scale + abs(c.impulse[0]) + abs(c.impulse[1]) + c.impulse[2] +
                 abs(c.local.mu));
  }
  accumulate<M>(p);
  const S relative = constant<S>(o.tolerance_relative),
          absolute = constant<S>(o.tolerance_absolute);
  const S allowed = constant<S>(o.residual_tolerance);
  // The change of a sweep says little below what the residual has to reach.
  const S tolerance_squared =
      min(madd(relative * relative, fastest, absolute * absolute), allowed * allowed);
  // False for NaN, and where products of block entries would overflow.
  const auto finite = sum < constant<S>(sizeof(Value<S>) == 4 ? 1e14 : 1e30);
  Outcome<S> out = iterate<M, kMaxDissipation>(p, finite, tolerance_squared, o.foresee, o, info);
  // Which of the lanes are not solved. The residuals of others stay: float would evaluate them anew
  // without double's help.
  S worst = zero;
  const auto unsolved = [&](Mask<S> lanes) {
    worst = select(lanes, out.certified ? out.residual : certify<M, kMaxDissipation>(p), worst);
    out.certified = false;
    auto bad = lanes & !(worst <= allowed);
    if (sizeof(Value<S>) == 4 && !kMaxDissipation && any(bad)) {
      worst = select(bad, certify_in_double<M>(p, bad), worst);
      bad = bad & !(worst <= allowed);
    }
    return bad;
  };
  auto bad = unsolved(finite);
  if (const auto again = bad & out.foreseen; any(again)) {
    out = iterate<M, kMaxDissipation>(p, again, tolerance_squared, false, o, info);
    ++info.resumed;
    bad = (bad & !again) | unsolved(again);
  }
  if (any(bad) && !kMaxDissipation && o.fallback) {
    run_fallback<M>(p, bad, allowed * constant<S>(0.9), info);
    bad = unsolved(bad);
  }
  if (any(bad) && release_jams<M, kMaxDissipation>(p, bad, sqrt(fastest), allowed)) unsolved(bad);
  worst = select(finite, worst, constant<S>(__builtin_nan("")));
  info.residual = worst;
  info.converged = finite & (worst <= allowed);
  for (int i = 0; i < p.size(); ++i) {
    FactoredContact<S>& c = p.contact(i);
    store(c.lambda, c.impulse);
    for (S& x : c.impulse) x = select(finite, x, zero);
  }
  if (any(!finite))
    for (int k = 0; k < p.dofs(); ++k) p.w[k] = select(finite, p.w[k], p.w0[k]);
}

/// Takes the impulses that each contact holds in place of the solver's, and returns their largest
/// residual of Coulomb's law [m/s]; writes the velocities. w must be theirs.
template <class S>
S certify_impulses(FactoredProblem<S>& p) {
  for (int i = 0; i < p.size(); ++i) set_impulse(p.contact(i), p.impulse(i));
  return p.six() ? certify<6, false>(p) : certify<0, false>(p);
}

/// Solves the problem in place: impulse(i), velocity(i) and w hold the answer.
template <class S>
FactoredInfo<S> solve_factored(FactoredProblem<S>& p,
                               const FactoredOptions& o = default_options<S>()) {
  FactoredInfo<S> info;
  if (o.max_dissipation)
    p.six() ? solve_factored_as<6, true>(p, o, info) : solve_factored_as<0, true>(p, o, info);
  else
    p.six() ? solve_factored_as<6, false>(p, o, info) : solve_factored_as<0, false>(p, o, info);
  return info;
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
