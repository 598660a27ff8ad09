#include "solvers/admm.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace stickslip::solvers {
namespace {

constexpr double kEta = 1e-6;  // proximal weight
constexpr double kTau = 0.5;   // share of rho that enters
constexpr double kRatio = 10;  // primal to dual residual at which rho changes
constexpr double kStart = 16;  // rho = 16 sqrt(L eta) at first, L the largest eigenvalue
constexpr double kGrowth = 2;  // of rho, or shrinking, where the residuals are out of balance
constexpr double kLargestChange = 1e10;  // of rho in all
constexpr int kSettle = 2;               // iterations between two changes: each costs factors
constexpr int kOfferEvery = 5;

}  // namespace

Admm::Admm(contact::ExplicitProblem& p)
    : p_(p),
      system_(p.n, std::pmr::get_default_resource()),
      all_(p.n),
      A_(9 * p.n),
      B_(9 * p.n),
      x_(3 * p.n),
      y_(3 * p.n),
      z_(3 * p.n),
      before_(3 * p.n) {
  std::iota(all_.begin(), all_.end(), 0);
  double trace = 0;
  for (int i = 0; i < p.n; ++i) trace += 3 * p.local[i].scale;
  if (trace > 0) unit_ = trace / (3 * p.n);
}

/// The matrix of (C50).
bool Admm::factor(double rho) {
  for (int i = 0; i < p_.n; ++i)
    for (int r = 0; r < 3; ++r) {
      A_[9 * i + 4 * r] = kEta + kTau * rho;
      B_[9 * i + 4 * r] = 1 / unit_;
    }
  return system_.factor(p_, all_, A_.data(), B_.data());
}

/// out = G x / unit
void Admm::multiply(const Doubles& x, Doubles& out) const {
  for (int i = 0; i < p_.n; ++i) {
    double sum[3] = {};
    contact::for_each_block(p_, i, [&](int j, const double* g, int stride) {
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s) sum[r] = madd(g[r * stride + s] / unit_, x[3 * j + s], sum[r]);
    });
    for (int r = 0; r < 3; ++r) out[3 * i + r] = sum[r];
  }
}

/// Of G / unit, by a few power steps from a fixed start: a tenth is precise enough for rho.
double Admm::largest_eigenvalue() {
  const int m = 3 * p_.n;
  for (int r = 0; r < m; ++r) x_[r] = 1 + 0.1 * (r % 7);
  double growth = 0;
  for (int k = 0; k < 12; ++k) {
    double square = 0;
    for (double x : x_) square += x * x;
    if (!(square > 0)) break;
    for (double& x : x_) x /= std::sqrt(square);
    multiply(x_, y_);
    x_.swap(y_);
    growth = 0;
    for (double x : x_) growth += x * x;
    growth = std::sqrt(growth);
  }
  return std::max(growth, 1e-3);
}

/// (C50) and (C51) in one pass over the contacts, then the rule for rho, (C52).
bool Admm::run(BestImpulse& best, int max_iterations) {
  const int m = 3 * p_.n;
  if (m == 0) return best.solved();
  const double first = kStart * std::sqrt(largest_eigenvalue() * kEta);
  double rho = first;
  if (!factor(rho)) return false;
  contact::refresh_velocity(p_);
  std::copy(p_.lambda, p_.lambda + m, y_.begin());
  x_ = y_;
  for (int r = 0; r < m; ++r) z_[r] = p_.v[r] / unit_;
  int changed = -kSettle;  // iteration of the last change of rho
  for (int k = 0; k < max_iterations; ++k) {
    ++iterations_;
    const double weight = kTau * rho;
    Doubles& right = before_;
    for (int i = 0; i < p_.n; ++i) {
      const double shift =
          p_.local[i].mu * std::sqrt(z_[3 * i] * z_[3 * i] + z_[3 * i + 1] * z_[3 * i + 1]);
      for (int r = 3 * i; r < 3 * i + 3; ++r)
        right[r] =
            kEta * x_[r] + weight * y_[r] + z_[r] - p_.c[r] / unit_ - (r % 3 == 2 ? shift : 0);
    }
    system_.solve(right.data());
    double primal = 0, dual = 0;
    for (int i = 0; i < p_.n; ++i) {
      double y[3];
      for (int r = 0; r < 3; ++r) y[r] = right[3 * i + r] - z_[3 * i + r] / weight;
      project_on_cone(p_.local[i].mu, y);
      if (!(p_.local[i].inv_zz > 0)) y[0] = y[1] = y[2] = 0;
      for (int r = 0; r < 3; ++r) {
        const int at = 3 * i + r;
        const double x = right[at];
        primal = std::max(primal, std::fabs(x - y[r]));
        dual = std::max(dual, std::fabs(weight * (y[r] - y_[at]) + kEta * (x - x_[at])));
        z_[at] -= weight * (x - y[r]);
        x_[at] = x;
        y_[at] = y[r];
      }
    }
    if (best.records() || k < kOfferEvery || k % kOfferEvery == 0 || k + 1 == max_iterations) {
      std::copy(y_.begin(), y_.end(), p_.lambda);
      if (best.offer(p_, SolveStage::kAdmm)) return true;
      if (!std::isfinite(primal + dual)) return false;
    }
    const bool grow = primal > kRatio * dual, shrink = dual > kRatio * primal;
    if (!(grow || shrink) || k - changed < kSettle) continue;
    const double next = rho * (grow ? kGrowth : 1 / kGrowth);
    if (!(next <= first * kLargestChange && next * kLargestChange >= first)) continue;
    rho = next;
    changed = k;
    if (!factor(rho)) return false;
  }
  return best.solved();
}

}  // namespace stickslip::solvers
