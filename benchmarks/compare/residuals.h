// Contact residuals of many robot-steps: how large, how often too large, and whether that was said.
#pragma once
#include <array>
#include <cmath>

namespace stickslip::benchmarks {

/// A histogram with 20 bins per decade: a quantile is right to 12 %.
class Residuals {
 public:
  Residuals() = default;
  /// tolerance: on residuals [m/s].
  explicit Residuals(double tolerance) : tolerance_(tolerance) {}

  /// residual [m/s]; flagged: the step said that it did not converge.
  void add(double residual, bool flagged) {
    ++count_;
    flagged_ += flagged;
    const bool bad = !(residual <= tolerance_);  // NaN is bad
    above_ += bad;
    unflagged_ += bad && !flagged;
    largest_ = std::fmax(largest_, std::isnan(residual) ? HUGE_VAL : residual);
    ++bins_[bin(residual)];
  }

  long count() const { return count_; }
  double tolerance() const { return tolerance_; }  ///< [m/s]
  double largest() const { return largest_; }      ///< [m/s]
  long flagged() const { return flagged_; }
  long unflagged() const { return unflagged_; }  ///< above the tolerance and not flagged
  double share_above() const { return count_ ? static_cast<double>(above_) / count_ : 0; }

  /// The residual that a share of the steps does not exceed [m/s]; 0: those that touch nothing.
  double quantile(double share) const {
    const double wanted = share * static_cast<double>(count_);
    double seen = 0;
    for (int k = 0; k < kBins; ++k) {
      seen += static_cast<double>(bins_[k]);
      if (seen >= wanted)
        return k == 0 ? 0 : std::fmin(largest_, kLeast * std::pow(10, k / kPerDecade));
    }
    return largest_;
  }

 private:
  static constexpr int kBins = 401;
  static constexpr double kLeast = 1e-18, kPerDecade = 20;

  static int bin(double residual) {
    if (residual == 0) return 0;
    const double k = std::ceil(kPerDecade * std::log10(residual / kLeast));
    return k >= 1 ? static_cast<int>(std::fmin(k, kBins - 1)) : std::isnan(k) ? kBins - 1 : 1;
  }

  double tolerance_ = 1e-8, largest_ = 0;
  long count_ = 0, above_ = 0, flagged_ = 0, unflagged_ = 0;
  std::array<long, kBins> bins_{};
};

}  // namespace stickslip::benchmarks
