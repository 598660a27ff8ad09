// Contacts that jam: friction that presses a contact harder into the ground than it slows it (mu
// |w| > 1, Painleve) may leave a problem without a finite solution (docs/theory/contact.md, section
// 4). What the methods leave there can be huge, or sink into the ground. The least bad answer is
// bounded and does not sink: such contacts are solved without friction, the others as they are.
#pragma once
#include "contact/fallback.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// What the impulses of a problem may be at most where it is not solved.
template <class S>
struct JamLimits {
  S impulse;  // scale |lambda| [m/s]
  S sinking;  // -v_z [m/s]
};
template <class S>
STICKSLIP_INLINE JamLimits<S> jam_limits(S fastest, S allowed) {
  return {constant<S>(1e6) * (fastest + allowed), madd(constant<S>(1e-3), fastest, allowed)};
}

/// scale |lambda| above the limit, or NaN.
template <class S>
STICKSLIP_INLINE Mask<S> is_absurd(const FactoredContact<S>& c, S limit) {
  S l[3];
  store(c.lambda, l);
  const S scale = c.local.scale, x = scale * l[0], y = scale * l[1], z = scale * l[2];
  return !(madd(x, x, madd(y, y, z * z)) <= limit * limit);
}
/// Absurd, or sinking though it can push. `velocity` is the contact's.
template <class S>
STICKSLIP_INLINE Mask<S> is_jammed(const FactoredContact<S>& c, const S velocity[3],
                                   const JamLimits<S>& limits) {
  return is_absurd(c, limits.impulse) |
         ((c.local.inv_zz > constant<S>(0)) & !(velocity[2] >= -limits.sinking));
}

/// Lanes with such contacts; velocities must be up to date (`certify`).
template <class S>
STICKSLIP_STAGE Mask<S> jammed_lanes(const FactoredProblem<S>& p, const JamLimits<S>& limits) {
  auto jam = none<S>();
  for (int i = 0; i < p.size(); ++i)
    jam = jam | is_jammed(p.contact(i), p.contact(i).velocity, limits);
  return jam;
}

/// Solves a jammed problem, one lane, prepared, again from rest, without friction where it jams.
template <int M, bool kMaxDissipation>
class JamRelease {
 public:
  JamRelease(FactoredProblem<double>& p, const JamLimits<double>& limits, double tolerance)
      : p_(p), limits_(limits), tolerance_(tolerance) {}

  void run() {
    accumulate<M>(p_);
    for (int i = 0; i < p_.size(); ++i) store(p_.contact(i).lambda, kept() + 3 * i);
    const bool absurd = any_absurd();
    const double sinking = deepest();
    // Whom the release of one contact jams is released next; the last round releases all.
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      if (!release_friction(round == kRounds - 1)) break;
      solve();
    }
    stop_winding();
    // Where even the normal impulses cannot prevent it, friction is not what sinks the contacts.
    if (!absurd && !(deepest() < 0.5 * sinking)) put(kept());
    for (int i = 0; i < p_.size(); ++i)
      p_.contact(i).local.mu = min(p_.contact(i).friction, kMaxFriction);
  }

 private:
  double* kept() { return p_.saved + 12 * p_.size(); }  // the fallback uses the slots before

  void put(const double* impulses) {
    const double none[3] = {};
    for (int i = 0; i < p_.size(); ++i) {
      const double* l = impulses ? impulses + 3 * i : none;
      set_impulse(p_.contact(i), l);
      reset_direction(p_.contact(i), l);
    }
    accumulate<M>(p_);
  }
  bool any_absurd() const {
    for (int i = 0; i < p_.size(); ++i)
      if (is_absurd(p_.contact(i), limits_.impulse)) return true;
    return false;
  }
  /// The fastest that a contact which can push sinks [m/s]; infinite for NaN.
  double deepest() const {
    double worst = 0;
    for (int i = 0; i < p_.size(); ++i) {
      const FactoredContact<double>& c = p_.contact(i);
      double v[3];
      contact_velocity<M>(c, p_.w, v);
      if (c.local.inv_zz > 0 && !(-v[2] <= worst)) worst = v[2] == v[2] ? -v[2] : 1e300;
    }
    return worst;
  }
  /// True if there was friction to take away.
  bool release_friction(bool all) {
    bool some = false;
    for (int i = 0; i < p_.size(); ++i) {
      FactoredContact<double>& c = p_.contact(i);
      double v[3];
      contact_velocity<M>(c, p_.w, v);
      if (!(c.local.mu > 0) ||
          !(all ? deepest() > limits_.sinking || any_absurd() : is_jammed(c, v, limits_)))
        continue;
      c.local.mu = 0;
      some = true;
    }
    return some;
  }
  void solve() {
    put(nullptr);
    for (int k = 0; k < 200; ++k)
      if (sweep<M, kMaxDissipation>(p_, true, 0.01 * tolerance_) < 0.01 * tolerance_ * tolerance_)
        break;
    if constexpr (kMaxDissipation)
      accumulate<M>(p_);
    else
      Fallback<M>(p_, tolerance_).run();
  }
  /// Contacts that contradict each other wind up without friction too. A few sweeps from rest are
  /// bounded: none of their visits adds energy.
  void stop_winding() {
    bool winding = false;
    for (int i = 0; i < p_.size(); ++i) {
      // c_z / G_zz is large where the contact can hardly push; that is in order.
      const LocalContact<double>& k = p_.contact(i).local;
      const double limit = limits_.impulse * max(1.0, 2e-6 * k.scale * k.inv_zz);
      winding = winding || is_absurd(p_.contact(i), limit);
    }
    if (!winding) return;
    for (int i = 0; i < p_.size(); ++i) p_.contact(i).local.mu = 0;
    put(nullptr);
    for (int k = 0; k < 20; ++k) sweep<M, kMaxDissipation>(p_, true, 0.01 * tolerance_);
    accumulate<M>(p_);
  }

  FactoredProblem<double>& p_;
  JamLimits<double> limits_;
  double tolerance_;
};

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
