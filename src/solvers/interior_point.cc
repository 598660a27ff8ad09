#include "solvers/interior_point.h"

#include <algorithm>
#include <cmath>

namespace stickslip::solvers {
namespace {

constexpr double kSmallestFriction = 1e-9;  // a cone without friction has no interior
constexpr int kPatience = 45;               // iterations without a better impulse

}  // namespace

InteriorPoint::InteriorPoint(contact::ExplicitProblem& p, Memory memory)
    : p_(p),
      system_(p.n, memory),
      active_(memory),
      cones_(memory),
      A_(9 * std::size_t(p.n), memory),
      B_(9 * std::size_t(p.n), memory),
      right_(memory),
      least_(3 * std::size_t(p.n), memory) {
  active_.reserve(p.n);
  for (int i = 0; i < p.n; ++i)
    if (p.local[i].inv_zz > 0) active_.push_back(i);
  cones_.resize(active_.size());
  right_.resize(3 * active_.size());
}

/// D of (C40), and x = y = a multiple of e that is as large as the free velocity.
void InteriorPoint::start() {
  double fastest = 0;
  for (std::size_t a = 0; a < cones_.size(); ++a) {
    const contact::LocalContact<double>& k = p_.local[active_[a]];
    Cone& c = cones_[a];
    const double mu = std::max(k.mu, kSmallestFriction);
    c.D[2] = std::sqrt(3 / (mu * mu * (k.xx + k.yy) + k.zz));
    c.D[0] = c.D[1] = mu * c.D[2];
    for (int r = 0; r < 3; ++r)
      fastest = std::max(fastest, std::fabs(p_.c[3 * active_[a] + r]) * c.D[r]);
  }
  for (Cone& c : cones_)
    for (int r = 0; r < 3; ++r) c.x[r] = c.y[r] = r == 2 ? fastest : 0;
}

/// lambda = D x, v from it, and F.
void InteriorPoint::evaluate(ShiftRule shift, bool first) {
  std::fill(p_.lambda, p_.lambda + 3 * p_.n, 0.0);
  for (std::size_t a = 0; a < cones_.size(); ++a)
    for (int r = 0; r < 3; ++r) p_.lambda[3 * active_[a] + r] = cones_[a].D[r] * cones_[a].x[r];
  contact::refresh_velocity(p_);
  for (std::size_t a = 0; a < cones_.size(); ++a) {
    Cone& c = cones_[a];
    const double t = tangential(c.y);
    c.shift = shift != ShiftRule::kDamped ? t : first ? 0 : 0.5 * (c.shift + t);
    for (int r = 0; r < 3; ++r)
      c.F[r] = c.D[r] * p_.v[3 * active_[a] + r] + (r == 2 ? c.shift : 0) - c.y[r];
  }
}

/// (D G D + C S^-2) of (C45) in the unknown dlambda = D dx, with C = 1 - z t^T where the shift is
/// exact.
bool InteriorPoint::factor(ShiftRule shift) {
  for (std::size_t a = 0; a < cones_.size(); ++a) {
    Cone& c = cones_[a];
    c.s = scaling(c.x, c.y);
    scale(c.s, 1, c.y, c.lambda);
    double *A = A_.data() + 9 * active_[a], *B = B_.data() + 9 * active_[a];
    inverse_square(c.s, A);
    if (const double t = tangential(c.y); shift == ShiftRule::kExact && t > 0)
      for (int k = 0; k < 3; ++k) A[6 + k] -= (c.y[0] * A[k] + c.y[1] * A[3 + k]) / t;
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 3; ++k) {
        A[3 * r + k] /= c.D[k];
        B[3 * r + k] = r == k ? c.D[r] : 0;
      }
  }
  return system_.factor(p_, active_, A_.data(), B_.data());
}

/// dx, dy of every contact from its complementarity and the linearized F = 0.
void InteriorPoint::step_direction() {
  for (std::size_t a = 0; a < cones_.size(); ++a) {
    Cone& c = cones_[a];
    double k[3], *right = right_.data() + 3 * a;
    divide(c.lambda, c.complementarity, k);
    scale(c.s, -1, k, c.dy);  // S^-1 k; the part of dx follows
    for (int r = 0; r < 3; ++r) right[r] = c.dy[r] - c.F[r];
    if (const double t = tangential(c.y); exact_ && t > 0)
      right[2] -= (c.y[0] * c.dy[0] + c.y[1] * c.dy[1]) / t;
  }
  system_.solve(right_.data());
  for (std::size_t a = 0; a < cones_.size(); ++a) {
    Cone& c = cones_[a];
    double once[3], twice[3];
    for (int r = 0; r < 3; ++r) c.dx[r] = right_[3 * a + r] / c.D[r];
    scale(c.s, -1, c.dx, once);
    scale(c.s, -1, once, twice);
    for (int r = 0; r < 3; ++r) c.dy[r] -= twice[r];
  }
}

double InteriorPoint::longest_step() const {
  double t = INFINITY;
  for (const Cone& c : cones_) t = std::min({t, to_boundary(c.x, c.dx), to_boundary(c.y, c.dy)});
  return t;
}

/// Predictor (C46): straight to the boundary. How far that gets says where on the central path to
/// aim: tau.
double InteriorPoint::predict() {
  double gap = 0, left = 0;
  for (Cone& c : cones_) {
    product(c.lambda, c.lambda, c.complementarity);
    for (double& x : c.complementarity) x = -x;
    gap += c.lambda[0] * c.lambda[0] + c.lambda[1] * c.lambda[1] + c.lambda[2] * c.lambda[2];
  }
  step_direction();
  const double reach = std::min(1.0, longest_step());
  for (const Cone& c : cones_)
    for (int r = 0; r < 3; ++r) left += (c.x[r] + reach * c.dx[r]) * (c.y[r] + reach * c.dy[r]);
  const double share = std::clamp(left / gap, 0.0, 1.0);
  return std::max(share * share * share, 1e-8) * gap / double(cones_.size());
}

/// Corrector: what the predictor neglected, and back towards the central path.
void InteriorPoint::correct(double center) {
  for (Cone& c : cones_) {
    double x[3], y[3], second[3];
    scale(c.s, -1, c.dx, x);
    scale(c.s, 1, c.dy, y);
    product(x, y, second);
    for (int r = 0; r < 3; ++r) c.complementarity[r] += (r == 2 ? center : 0) - second[r];
  }
  step_direction();
}

/// Nearly to the boundary. False where no step is left, or it is not finite.
bool InteriorPoint::advance() {
  const double t = std::min(1.0, 0.995 * longest_step());
  double sum = 0;
  for (Cone& c : cones_)
    for (int r = 0; r < 3; ++r) {
      c.x[r] += t * c.dx[r];
      c.y[r] += t * c.dy[r];
      sum += c.x[r] + c.y[r];
    }
  return std::isfinite(sum) && t >= 1e-10;
}

bool InteriorPoint::run(BestImpulse& best, ShiftRule shift, int max_iterations) {
  if (cones_.empty()) return best.solved();
  exact_ = shift == ShiftRule::kExact;
  start();
  double least = INFINITY;
  for (int k = 0, since = 0; k < max_iterations && since < kPatience; ++k, ++since) {
    evaluate(shift, k == 0);
    if (best.offer(p_, SolveStage::kInteriorPoint)) return true;
    if (const double r = best.last_residual(); r < least) {
      if (r < 0.9 * least) since = 0;
      least = r;
      least_.assign(p_.lambda, p_.lambda + 3 * p_.n);
    }
    ++iterations_;
    if (!factor(shift)) break;
    correct(predict());
    if (!advance()) break;
  }
  if (least < INFINITY) std::copy(least_.begin(), least_.end(), p_.lambda);
  contact::refresh_velocity(p_);
  return best.solved();
}

}  // namespace stickslip::solvers
