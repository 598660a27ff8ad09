#include "solvers/prox_newton.h"

#include <algorithm>
#include <cmath>

namespace stickslip::solvers {
namespace {

constexpr int kMaxInner = 15;  // Newton steps of one subproblem
constexpr int kMaxHalvings = 10;
constexpr int kMemory = 4;  // merits that a step may be compared with: non-monotone
constexpr double kSmallestAlpha = 1e-12, kLargestAlpha = 1e5;

}  // namespace

ProxNewton::ProxNewton(contact::ExplicitProblem& p, Memory memory)
    : p_(p), system_(p.n, memory), memory_(36 * std::size_t(p.n), memory), active_(memory) {
  double* next = memory_.data();
  for (double** vector : {&center_, &origin_, &direction_, &right_, &u_, &F_}) {
    *vector = next;
    next += 3L * p.n;
  }
  A_ = next;
  B_ = next + 9L * p.n;
  active_.reserve(p.n);
}

/// u = v + alpha scale (lambda - center), (C35).
void ProxNewton::shift_velocity(double alpha) {
  for (int i = 0; i < p_.n; ++i) {
    const double weight = alpha * p_.local[i].scale;
    for (int r = 3 * i; r < 3 * i + 3; ++r) u_[r] = p_.v[r] + weight * (p_.lambda[r] - center_[r]);
  }
}

/// (C36).
double ProxNewton::merit() {
  double sum = 0;
  for (int i = 0; i < p_.n; ++i) {
    double F[3];
    alart_curnier_value(p_.local[i], p_.lambda + 3 * i, u_ + 3 * i, F);
    sum += squared(F);
  }
  return std::sqrt(sum);
}

/// Newton direction (C39) at (lambda, u). Contacts that are not active go to zero; their part moves
/// to the right-hand side.
bool ProxNewton::direction(double alpha) {
  active_.clear();
  bool some_leave = false;
  for (int i = 0; i < p_.n; ++i) {
    AlartCurnier c;
    alart_curnier(p_.local[i], p_.lambda + 3 * i, u_ + 3 * i, c);
    const double weight = alpha * p_.local[i].scale;
    for (int r = 0; r < 9; ++r) {
      A_[9 * i + r] = c.A[r] + weight * c.B[r];
      B_[9 * i + r] = c.B[r];
    }
    for (int r = 0; r < 3; ++r) F_[3 * i + r] = c.F[r];
    if (c.active) {
      active_.push_back(i);
      continue;
    }
    for (int r = 0; r < 3; ++r) {
      direction_[3 * i + r] = -p_.lambda[3 * i + r];
      some_leave = some_leave || direction_[3 * i + r] != 0;
    }
  }
  double* x = right_;
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const int i = active_[a];
    double moved[3] = {0, 0, 0};
    if (some_leave)
      contact::for_each_block(p_, i, [&](int j, const double* g, int stride) {
        if (std::binary_search(active_.begin(), active_.end(), j)) return;
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s) moved[r] += g[r * stride + s] * direction_[3 * j + s];
      });
    for (int r = 0; r < 3; ++r) {
      const double* b = B_ + 9 * i + 3 * r;
      x[3 * a + r] = -F_[3 * i + r] - (b[0] * moved[0] + b[1] * moved[1] + b[2] * moved[2]);
    }
  }
  if (active_.empty()) return true;
  if (!system_.solve_once(p_, active_, A_, B_, x)) return false;
  double sum = 0;
  for (std::size_t a = 0; a < active_.size(); ++a)
    for (int r = 0; r < 3; ++r) {
      direction_[3 * active_[a] + r] = x[3 * a + r];
      sum += x[3 * a + r];
    }
  return std::isfinite(sum);
}

/// Newton with backtracking (C37) on one subproblem, from p.lambda (p.v up to date). True if
/// solved.
bool ProxNewton::subproblem(BestImpulse& best, double alpha, double start_residual,
                            double tolerance, int max_steps) {
  double history[kMemory];
  shift_velocity(alpha);
  double m = merit();
  for (int inner = 0; inner < kMaxInner; ++inner) {
    if (m <= 0.1 * tolerance || (inner > 0 && m <= 1e-2 * std::min(1.0, alpha) * start_residual))
      return true;
    if (inner >= max_steps) return false;
    history[inner % kMemory] = m;
    const double worst = *std::max_element(history, history + std::min(inner + 1, kMemory));
    ++steps_;
    if (!direction(alpha)) return false;
    std::copy(p_.lambda, p_.lambda + 3 * p_.n, origin_);
    double t = 1;
    for (int halving = 0; halving < kMaxHalvings; ++halving, t *= 0.5) {
      for (int r = 0; r < 3 * p_.n; ++r) p_.lambda[r] = origin_[r] + t * direction_[r];
      contact::refresh_velocity(p_);
      shift_velocity(alpha);
      m = merit();
      if (m <= (1 - 1e-4 * t) * worst) break;
    }
    if (!std::isfinite(m)) return false;
    if (best.records()) best.record_projected(p_, SolveStage::kProxNewton);
  }
  return false;
}

/// The weights of (C38).
bool ProxNewton::run(BestImpulse& best, double alpha, int max_steps) {
  const int last = steps_ + max_steps;
  // A sliding velocity counts mu times in the residual, once in the merit.
  double most_friction = 0;
  for (int i = 0; i < p_.n; ++i) most_friction = std::max(most_friction, p_.local[i].mu);
  const double tolerance = best.tolerance() / (1 + most_friction);
  project_on_cones(p_);
  contact::refresh_velocity(p_);
  double residual = contact::reachable_residual(p_, false);
  int failures = 0;
  while (!best.solved() && steps_ < last && alpha <= kLargestAlpha) {
    std::copy(p_.lambda, p_.lambda + 3 * p_.n, center_);
    const int before = steps_;
    const bool solved = subproblem(best, alpha, residual, tolerance, last - steps_);
    if (best.offer(p_, SolveStage::kProxNewton, true)) return true;
    const double reached = best.last_residual();
    if (solved && reached < 3 * residual) {
      alpha = std::max(alpha * (reached < 0.5 * residual ? 0.1 : 0.2), kSmallestAlpha);
      residual = reached;
      failures = 0;
    } else {
      alpha *= failures == 0 ? 10 : 3;
      std::copy(center_, center_ + 3 * p_.n, p_.lambda);
      contact::refresh_velocity(p_);
      if (++failures >= 4) {
        best.restore(p_);
        residual = best.residual();
      }
    }
    if (steps_ == before) break;  // no step left to take: rounding is all that is left
  }
  return best.solved();
}

bool ProxNewton::step(double alpha) {
  std::copy(p_.lambda, p_.lambda + 3 * p_.n, center_);
  std::copy(p_.v, p_.v + 3 * p_.n, u_);
  ++steps_;
  if (!direction(alpha)) return false;
  for (int r = 0; r < 3 * p_.n; ++r) p_.lambda[r] = center_[r] + direction_[r];
  return true;
}

}  // namespace stickslip::solvers
