// A contact problem v = G lambda + c, G dense or block sparse, whose velocities are kept up to date
// while impulses change (docs/theory/solvers.md, sections 1 and 3).
//
// Owns no memory: the caller hands in the arrays and a workspace, so a step can solve without
// allocating. The stopping tests of the sweeps are here too; all are functions of (G, c, mu,
// lambda) alone once `refresh_velocity` has been called.
#pragma once
#include "contact/residual.h"
#include "contact/single.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

struct ExplicitProblem {
  int n = 0;                   // contacts
  const double* G = nullptr;   // symmetric [1/kg]: (3n, 3n) row-major, or blocks (k, 3, 3)
  const double* c = nullptr;   // (3n) [m/s]
  const double* mu = nullptr;  // (n) [1]
  double* lambda = nullptr;    // (3n) in: start, out: solution [N s]
  // Workspace.
  LocalContact<double>* local = nullptr;  // (n)
  double* v = nullptr;                    // (3n) G lambda + c [m/s]
  double* rounding = nullptr;             // (3n) scratch of `refresh_velocity`
  // Block sparse G, null where it is dense: row i of blocks is starts[i] .. starts[i + 1] - 1,
  // block k belongs to column columns[k] (ascending, both triangles, every diagonal block).
  const int* starts = nullptr;   // (n + 1)
  const int* columns = nullptr;  // (k)

  /// Doubles that `attach` needs for n contacts.
  static constexpr long workspace_size(int n) {
    return n * static_cast<long>(sizeof(LocalContact<double>) / sizeof(double)) + 6L * n;
  }
  void attach(double* workspace) {
    local = reinterpret_cast<LocalContact<double>*>(workspace);
    v = workspace + n * static_cast<long>(sizeof(LocalContact<double>) / sizeof(double));
    rounding = v + 3L * n;
  }
  const double* row(int r) const { return G + static_cast<long>(r) * 3 * n; }
};

/// Calls f(j, block, stride) for the blocks of row i: entry (r, s) of G_ij is block[r * stride +
/// s].
template <class F>
STICKSLIP_INLINE void for_each_block(const ExplicitProblem& p, int i, F&& f) {
  if (p.starts) {
    for (int k = p.starts[i]; k < p.starts[i + 1]; ++k) f(p.columns[k], p.G + 9L * k, 3);
  } else {
    const double* g = p.row(3 * i);
    for (int j = 0; j < p.n; ++j) f(j, g + 3 * j, 3 * p.n);
  }
}

/// Two contacts that do not couple.
inline bool is_zero_block(const double* g, int stride) {
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s)
      if (g[long(r) * stride + s] != 0) return false;
  return true;
}

/// One term more of a sum in twice the precision: (sum, rest) += a b. Fused and error-free
/// transformations, so that a velocity which is the small difference of large terms keeps its
/// digits.
STICKSLIP_INLINE void add_product(double a, double b, double& sum, double& rest) {
  const double product = a * b, low = madd(a, b, -product);
  const double next = sum + product, back = next - sum;
  rest += ((sum - (next - back)) + (product - back)) + low;
  sum = next;
}

/// v = G lambda + c from scratch, rounded once (C27): with mass ratios of 1e6 a plain sum would
/// drown 1e-8 of c in the rounding of the impulses.
inline void refresh_velocity(ExplicitProblem& p) {
  const int m = 3 * p.n;
  double* __restrict__ v = p.v, * __restrict__ rest = p.rounding;
  for (int r = 0; r < m; ++r) v[r] = p.c[r], rest[r] = 0;
  if (p.starts) {
    for (int i = 0; i < p.n; ++i)
      for_each_block(p, i, [&](int j, const double* g, int) {
        const double* l = p.lambda + 3 * j;
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s)
            add_product(g[3 * r + s], l[s], v[3 * i + r], rest[3 * i + r]);
      });
  } else {
    for (int j = 0; j < m; ++j) {
      const double* __restrict__ g = p.row(j);  // row = column: G is symmetric
      const double l = p.lambda[j];
      if (l == 0) continue;
      for (int r = 0; r < m; ++r) add_product(g[r], l, v[r], rest[r]);
    }
  }
  for (int r = 0; r < m; ++r) v[r] += rest[r];
}

/// Local blocks and velocities; call once G, c, mu and lambda are set.
inline void prepare(ExplicitProblem& p) {
  for (int i = 0; i < p.n; ++i) {
    LocalContact<double>& k = p.local[i];
    const double *x = nullptr, *y = nullptr, *z = nullptr;
    if (p.starts) {
      for (int b = p.starts[i]; b < p.starts[i + 1]; ++b)
        if (p.columns[b] == i) x = p.G + 9L * b, y = x + 3, z = y + 3;
    } else {
      x = p.row(3 * i) + 3 * i, y = x + 3 * p.n, z = y + 3 * p.n;
    }
    k.xx = x[0], k.xy = x[1], k.xz = x[2], k.yy = y[1], k.yz = y[2], k.zz = z[2];
    k.mu = min(p.mu[i], kMaxFriction);
    prepare(k);
  }
  refresh_velocity(p);
}

/// c_i of (C4): the velocity of contact i without its own impulse, from the newest impulses of all
/// others.
STICKSLIP_INLINE void velocity_without_own(const ExplicitProblem& p, int i, double c[3]) {
  double own[3];
  apply_block(p.local[i], p.lambda + 3 * i, own);
  for (int r = 0; r < 3; ++r) c[r] = p.v[3 * i + r] - own[r];
}

/// Changes one impulse component and with it all velocities (row = column: G is symmetric).
STICKSLIP_INLINE void add_component(ExplicitProblem& p, int r, double d) {
  p.lambda[r] += d;
  if (p.starts) {
    for_each_block(p, r / 3, [&](int j, const double* g, int) {
      for (int s = 0; s < 3; ++s) p.v[3 * j + s] = madd(g[3 * (r % 3) + s], d, p.v[3 * j + s]);
    });
    return;
  }
  const int m = 3 * p.n;
  const double* __restrict__ g = p.row(r);
  double* __restrict__ v = p.v;
  for (int j = 0; j < m; ++j) v[j] = madd(g[j], d, v[j]);
}

/// Changes the impulse of contact i.
STICKSLIP_INLINE void add_impulse(ExplicitProblem& p, int i, const double d[3]) {
  for (int r = 0; r < 3; ++r) p.lambda[3 * i + r] += d[r];
  const double d0 = d[0], d1 = d[1], d2 = d[2];
  if (p.starts) {
    for_each_block(p, i, [&](int j, const double* g, int) {
      double* v = p.v + 3 * j;
      for (int s = 0; s < 3; ++s)
        v[s] = madd(g[s], d0, madd(g[3 + s], d1, madd(g[6 + s], d2, v[s])));
    });
    return;
  }
  const int m = 3 * p.n;
  const double* __restrict__ x = p.row(3 * i), * __restrict__ y = x + m, * __restrict__ z = y + m;
  double* __restrict__ v = p.v;
  for (int j = 0; j < m; ++j) v[j] = madd(x[j], d0, madd(y[j], d1, madd(z[j], d2, v[j])));
}

/// Residual of contact i [m/s], (C3) for Coulomb's law, (C25) for maximum dissipation: |G_ii
/// (lambda_i - exact_i)| with the others held, and the speed of approach where the contact cannot
/// push.
inline double contact_residual(const ExplicitProblem& p, int i, bool max_dissipation) {
  const LocalContact<double>& k = p.local[i];
  const double *v = p.v + 3 * i, *lambda = p.lambda + 3 * i;
  const double rounding = impulse_rounding(k, lambda);
  if (!max_dissipation) return natural_map_residual(k, v, lambda) + rounding;
  double c[3], own[3];
  velocity_without_own(p, i, c);
  const double speed = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
  const SlipSolution s = solve_single<Method::kHalley, true>(k, c, 1e-15 * speed);
  const double d[3] = {lambda[0] - s.x, lambda[1] - s.y, lambda[2] - s.z};
  apply_block(k, d, own);
  const double approach = k.inv_zz > 0 ? 0.0 : max(-v[2], 0.0);
  return sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2] + approach * approach) + rounding;
}

/// The largest of them; NaN counts as infinite.
inline double largest_residual(const ExplicitProblem& p, bool max_dissipation) {
  double worst = 0;
  for (int i = 0; i < p.n; ++i) {
    const double e = contact_residual(p, i, max_dissipation);
    if (!(e <= worst)) worst = e == e ? e : __builtin_inf();
  }
  return worst;
}

/// The same over the contacts that can push: what a solver can do something about. A contact that
/// is held along its normal and driven in must not decide which impulse is best for the others.
inline double reachable_residual(const ExplicitProblem& p, bool max_dissipation) {
  double worst = 0;
  for (int i = 0; i < p.n; ++i) {
    if (!(p.local[i].inv_zz > 0)) continue;
    const double e = contact_residual(p, i, max_dissipation);
    if (!(e <= worst)) worst = e == e ? e : __builtin_inf();
  }
  return worst;
}

/// What contact i violates of its law [m/s], (C26), without solving anything: the least of what it
/// would violate as an open, a sticking and a sliding contact (impulses times `scale`). Zero
/// exactly at a solution, under either law.
inline double contact_violation(const ExplicitProblem& p, int i, bool max_dissipation) {
  const LocalContact<double>& k = p.local[i];
  const double *v = p.v + 3 * i, *l = p.lambda + 3 * i;
  const double tangential = sqrt(l[0] * l[0] + l[1] * l[1]), edge = k.mu * l[2] - tangential;
  const double open = k.scale * sqrt(tangential * tangential + l[2] * l[2]) + max(-v[2], 0.0);
  const double stick = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + k.scale * max(-edge, 0.0);
  // Sliding: v_T against n = e + kappa mu w, and not along it. An impulse that hardly counts may
  // point anywhere: an angle violates |v_T| times it or scale |lambda_T| times it, the lesser.
  double turn = 0;
  if (tangential > 0) {
    const double bend = max_dissipation ? k.mu : 0;
    const double nx = l[0] / tangential + bend * k.wx, ny = l[1] / tangential + bend * k.wy;
    const double length = max(sqrt(nx * nx + ny * ny), 1e-300);
    const double along = abs(v[1] * nx - v[0] * ny) / length;
    const double push = max(v[0] * nx + v[1] * ny, 0.0) / length;
    const double speed = max(sqrt(v[0] * v[0] + v[1] * v[1]), 1e-300);
    turn = (along + push) * min(1.0, k.scale * tangential / speed);
  }
  const double slip = k.scale * abs(edge) + max(-l[2], 0.0) * k.scale + abs(v[2]) + turn;
  return min(open, min(stick, slip));
}

/// "The exact violations of the physical constraints", added ([Hwangbo 2018] section V.C) [m/s].
inline double violation_sum(const ExplicitProblem& p, bool max_dissipation) {
  double sum = 0;
  for (int i = 0; i < p.n; ++i) sum += contact_violation(p, i, max_dissipation);
  return sum;
}

/// What ends a sweep loop once it is at most the tolerance.
enum class StopTest {
  kResidual,  ///< the largest residual of contacts that can push [m/s]: the project's certificate
  kViolationSum,  ///< the paper's test for per-contact iteration [m/s]
  kUpdateSum,     ///< the paper's test for PGS: impulse updates [N s] and penetration velocities
                  ///< [m/s], added
};

struct SweepOptions {
  bool max_dissipation = false;
  Method method = Method::kHalley;  ///< per_contact only
  StopTest stop = StopTest::kResidual;
  double tolerance = 1e-9;  ///< of the stop test
  int max_sweeps = 1000;
  double alpha = 1, alpha_min = 0.7,
         gamma = 1;  ///< [Hwangbo 2018] Algorithm 2; PGS: alpha of eq. 18, constant
  double local_tolerance =
      0;  ///< of the single-contact method [N s]; 0: a tenth of what `tolerance` needs
  /// Called with `history` and the value of the stop test after each sweep, if not null.
  void (*record)(void* history, double error) = nullptr;
  void* history = nullptr;
};

struct SweepResult {
  int sweeps = 0;
  double error = 0;  ///< of the stop test
  bool converged = false;
};

/// The stop test on the velocities that the sweep kept; `updates` is its own sum for kUpdateSum.
inline double stop_error(const ExplicitProblem& p, const SweepOptions& o, double updates) {
  if (o.stop == StopTest::kUpdateSum) {
    for (int i = 0; i < p.n; ++i) updates += max(-p.v[3 * i + 2], 0.0);
    return updates;
  }
  if (o.stop == StopTest::kViolationSum) return violation_sum(p, o.max_dissipation);
  if (o.max_dissipation) {
    // The residual costs a solve per contact; it is worth that only where the violations are small
    // already.
    double worst = 0;
    for (int i = 0; i < p.n; ++i)
      if (p.local[i].inv_zz > 0) worst = max(worst, contact_violation(p, i, true));
    if (worst > o.tolerance) return worst;
  }
  return reachable_residual(p, o.max_dissipation);
}

/// Ends a sweep: true if the loop is done. Convergence counts only with velocities computed from
/// scratch, so that what the sweeps accumulated in rounding cannot hide.
inline bool end_sweep(ExplicitProblem& p, const SweepOptions& o, double updates, SweepResult& r) {
  r.error = stop_error(p, o, updates);
  if (r.error <= o.tolerance) {
    refresh_velocity(p);
    r.error = stop_error(p, o, updates);
  }
  if (o.record) o.record(o.history, r.error);
  ++r.sweeps;
  r.converged = r.error <= o.tolerance;
  return r.converged || !(r.error < 1e300);
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
