#include "solvers/interior_point.h"

#include <algorithm>
#include <cmath>

namespace stickslip::solvers {
namespace {

constexpr double kSmallestFriction = 1e-9;  // a cone without friction has no interior
constexpr int kPatience = 45;               // iterations without a better impulse
constexpr double kInside = 1e-17;           // of x_z squared: the least distance to the boundary

// The cone {x_z >= |x_T|} as a Jordan algebra; z is the scalar part.
double tangential(const double x[3]) { return std::sqrt(x[0] * x[0] + x[1] * x[1]); }
/// Not negative: iterates may lie as near to the boundary as rounding lets them.
double determinant(const double x[3]) {
  const double t = tangential(x);
  return std::max((x[2] - t) * (x[2] + t), kInside * x[2] * x[2]);
}
void product(const double x[3], const double y[3], double out[3]) {
  out[0] = x[2] * y[0] + y[2] * x[0];
  out[1] = x[2] * y[1] + y[2] * x[1];
  out[2] = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}
/// k with l o k = r.
void divide(const double l[3], const double r[3], double k[3]) {
  const double det = determinant(l);
  k[2] = (l[2] * r[2] - l[0] * r[0] - l[1] * r[1]) / det;
  for (int i = 0; i < 2; ++i) k[i] = (r[i] - k[2] * l[i]) / l[2];
}
/// The largest t up to which x + t d stays in the cone.
double to_boundary(const double x[3], const double d[3]) {
  const double a = (d[2] - tangential(d)) * (d[2] + tangential(d));
  const double b = x[2] * d[2] - x[0] * d[0] - x[1] * d[1], c = determinant(x);
  double t = INFINITY;
  if (const double disc = b * b - a * c; disc >= 0) {
    const double q = -(b + std::copysign(std::sqrt(disc), b));
    if (a != 0 && q / a > 0) t = q / a;
    if (q != 0 && c / q > 0) t = std::min(t, c / q);
  }
  if (d[2] < 0) t = std::min(t, -x[2] / d[2]);
  return t;
}

/// Scaling point of Nesterov and Todd (C43): S = eta V(w) with S y = S^-1 x.
struct Scaling {
  double w[3], eta;
};
Scaling scaling(const double x[3], const double y[3]) {
  const double dx = std::sqrt(determinant(x)), dy = std::sqrt(determinant(y));
  double a[3], b[3];
  for (int i = 0; i < 3; ++i) a[i] = x[i] / dx, b[i] = y[i] / dy;
  const double g = std::sqrt(0.5 * (1 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]));
  return {{(a[0] - b[0]) / (2 * g), (a[1] - b[1]) / (2 * g), (a[2] + b[2]) / (2 * g)},
          std::sqrt(dx / dy)};
}
/// out = S x, or S^-1 x with sign = -1.
void scale(const Scaling& s, double sign, const double x[3], double out[3]) {
  const double w0 = sign * s.w[0], w1 = sign * s.w[1], along = w0 * x[0] + w1 * x[1];
  const double eta = sign > 0 ? s.eta : 1 / s.eta, f = x[2] + along / (1 + s.w[2]);
  out[0] = eta * (x[0] + f * w0);
  out[1] = eta * (x[1] + f * w1);
  out[2] = eta * (s.w[2] * x[2] + along);
}
/// S^-2, (3, 3) row-major: (2 v v^T - J) / eta^2 with v = J w.
void inverse_square(const Scaling& s, double out[9]) {
  const double v[3] = {-s.w[0], -s.w[1], s.w[2]}, f = 1 / (s.eta * s.eta);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      out[3 * r + c] = f * (2 * v[r] * v[c] + (r != c ? 0 : r == 2 ? -1 : 1));
}

}  // namespace

InteriorPoint::InteriorPoint(contact::ExplicitProblem& p, Memory memory)
    : p_(p),
      system_(p.n, memory),
      active_(memory),
      A_(9 * std::size_t(p.n), memory),
      B_(9 * std::size_t(p.n), memory),
      right_(memory),
      x_(memory),
      y_(memory),
      dx_(memory),
      dy_(memory),
      F_(memory),
      lambda_(memory),
      complementarity_(memory),
      scaling_(memory),
      shift_(memory),
      least_(3 * std::size_t(p.n), memory),
      D_(memory) {
  active_.reserve(p.n);
  for (int i = 0; i < p.n; ++i)
    if (p.local[i].inv_zz > 0) active_.push_back(i);
  const std::size_t count = active_.size();
  for (Doubles* v : {&x_, &y_, &dx_, &dy_, &F_, &lambda_, &right_, &complementarity_})
    v->resize(3 * count);
  scaling_.resize(4 * count);
  shift_.resize(count);
  D_.resize(2 * count);
}

/// D of (C40) and the first x and y.
void InteriorPoint::start() {
  double fastest = 0;
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const int i = active_[a];
    const contact::LocalContact<double>& k = p_.local[i];
    const double mu = std::max(k.mu, kSmallestFriction);
    const double e = std::sqrt(3 / (mu * mu * (k.xx + k.yy) + k.zz));
    D_[2 * a] = mu * e;
    D_[2 * a + 1] = e;
    for (int r = 0; r < 3; ++r)
      fastest = std::max(fastest, std::fabs(p_.c[3 * i + r]) * D_[2 * a + (r == 2)]);
  }
  for (std::size_t a = 0; a < active_.size(); ++a)
    for (int r = 0; r < 3; ++r) x_[3 * a + r] = y_[3 * a + r] = r == 2 ? fastest : 0;
}

/// lambda = D x, v from it, and what y lacks of (C41): F = D v + shift - y.
void InteriorPoint::evaluate(ShiftRule shift, bool first) {
  std::fill(p_.lambda, p_.lambda + 3 * p_.n, 0.0);
  for (std::size_t a = 0; a < active_.size(); ++a)
    for (int r = 0; r < 3; ++r)
      p_.lambda[3 * active_[a] + r] = D_[2 * a + (r == 2)] * x_[3 * a + r];
  contact::refresh_velocity(p_);
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const double t = tangential(y_.data() + 3 * a);
    shift_[a] = shift == ShiftRule::kDamped ? (first ? 0 : 0.5 * (shift_[a] + t)) : t;
    for (int r = 0; r < 3; ++r)
      F_[3 * a + r] = D_[2 * a + (r == 2)] * p_.v[3 * active_[a] + r] + (r == 2 ? shift_[a] : 0) -
                      y_[3 * a + r];
  }
}

/// (D G D + C S^-2) of (C45) in the unknown dlambda = D dx, with C = 1 - z t^T where the shift is
/// exact.
bool InteriorPoint::factor(ShiftRule shift) {
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const double *x = x_.data() + 3 * a, *y = y_.data() + 3 * a;
    const Scaling s = scaling(x, y);
    for (int r = 0; r < 3; ++r) scaling_[4 * a + r] = s.w[r];
    scaling_[4 * a + 3] = s.eta;
    scale(s, 1, y, lambda_.data() + 3 * a);
    double* A = A_.data() + 9 * active_[a];
    double* B = B_.data() + 9 * active_[a];
    inverse_square(s, A);
    if (const double t = tangential(y); shift == ShiftRule::kExact && t > 0)
      for (int c = 0; c < 3; ++c) A[6 + c] -= (y[0] * A[c] + y[1] * A[3 + c]) / t;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        A[3 * r + c] /= D_[2 * a + (c == 2)];
        B[3 * r + c] = r == c ? D_[2 * a + (r == 2)] : 0;
      }
  }
  return system_.factor(p_, active_, A_.data(), B_.data());
}

/// (C44) by (C45): dx, dy with S^-1 dx + S dy = lambda \ complementarity and the linearized F = 0.
void InteriorPoint::step_direction(const Doubles& complementarity) {
  // right_ becomes S^-1 k, dx_ the right-hand side C S^-1 k - F.
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const Scaling s = {{scaling_[4 * a], scaling_[4 * a + 1], scaling_[4 * a + 2]},
                       scaling_[4 * a + 3]};
    double k[3], *b = right_.data() + 3 * a;
    divide(lambda_.data() + 3 * a, complementarity.data() + 3 * a, k);
    scale(s, -1, k, b);
    for (int r = 0; r < 3; ++r) dx_[3 * a + r] = b[r] - F_[3 * a + r];
    const double *y = y_.data() + 3 * a, t = tangential(y);
    if (exact_ && t > 0) dx_[3 * a + 2] -= (y[0] * b[0] + y[1] * b[1]) / t;
  }
  system_.solve(dx_.data());
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const Scaling s = {{scaling_[4 * a], scaling_[4 * a + 1], scaling_[4 * a + 2]},
                       scaling_[4 * a + 3]};
    double once[3], twice[3], *d = dx_.data() + 3 * a;
    for (int r = 0; r < 3; ++r) d[r] /= D_[2 * a + (r == 2)];
    scale(s, -1, d, once);
    scale(s, -1, once, twice);
    for (int r = 0; r < 3; ++r) dy_[3 * a + r] = right_[3 * a + r] - twice[r];
  }
}

double InteriorPoint::longest_step() const {
  double t = INFINITY;
  for (std::size_t a = 0; a < active_.size(); ++a)
    t = std::min({t, to_boundary(x_.data() + 3 * a, dx_.data() + 3 * a),
                  to_boundary(y_.data() + 3 * a, dy_.data() + 3 * a)});
  return t;
}

bool InteriorPoint::run(BestImpulse& best, ShiftRule shift, int max_iterations) {
  const std::size_t m = x_.size();
  if (m == 0) return best.solved();
  exact_ = shift == ShiftRule::kExact;
  start();
  double least = INFINITY;
  Doubles& complementarity = complementarity_;
  for (int k = 0, since = 0; k < max_iterations && since < kPatience; ++k, ++since) {
    evaluate(shift, k == 0);
    if (best.offer(p_, SolveStage::kInteriorPoint)) return true;
    if (best.last_residual() < least) {
      if (best.last_residual() < 0.9 * least) since = 0;
      least = best.last_residual();
      least_.assign(p_.lambda, p_.lambda + 3 * p_.n);
    }
    ++iterations_;
    if (!factor(shift)) break;
    // Predictor (C46): straight to the boundary.
    double gap = 0;
    for (std::size_t a = 0; a < active_.size(); ++a) {
      const double* l = lambda_.data() + 3 * a;
      product(l, l, complementarity.data() + 3 * a);
      gap += squared(l);
    }
    for (double& c : complementarity) c = -c;
    step_direction(complementarity);
    const double reach = std::min(1.0, longest_step());
    double left = 0;
    for (std::size_t i = 0; i < m; ++i) left += (x_[i] + reach * dx_[i]) * (y_[i] + reach * dy_[i]);
    const double share = std::clamp(left / gap, 0.0, 1.0);
    const double center = std::max(share * share * share, 1e-8) * gap / double(active_.size());
    // Corrector: what the predictor neglected, and back towards the central path.
    for (std::size_t a = 0; a < active_.size(); ++a) {
      const Scaling s = {{scaling_[4 * a], scaling_[4 * a + 1], scaling_[4 * a + 2]},
                         scaling_[4 * a + 3]};
      double sx[3], sy[3], second[3];
      scale(s, -1, dx_.data() + 3 * a, sx);
      scale(s, 1, dy_.data() + 3 * a, sy);
      product(sx, sy, second);
      for (int r = 0; r < 3; ++r) complementarity[3 * a + r] += (r == 2 ? center : 0) - second[r];
    }
    step_direction(complementarity);
    const double t = std::min(1.0, 0.995 * longest_step());
    double sum = 0;
    for (std::size_t i = 0; i < m; ++i) {
      x_[i] += t * dx_[i];
      y_[i] += t * dy_[i];
      sum += x_[i] + y_[i];
    }
    if (!std::isfinite(sum) || t < 1e-10) break;
  }
  if (least < INFINITY) std::copy(least_.begin(), least_.end(), p_.lambda);
  contact::refresh_velocity(p_);
  return best.solved();
}

}  // namespace stickslip::solvers
