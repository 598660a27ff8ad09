// The gate through which threads come to help with a round of work, as long as it is open. Only
// those inside are waited for: one whose core is busy with something else comes too late, or never.
#pragma once
#include <atomic>
#include <cstdint>

namespace stickslip::backend {

class RoundGate {
 public:
  /// The round under way, or the last one; 0 before the first. After 2^32 rounds they begin again:
  /// a helper that slept through all of them misses one.
  std::uint64_t round() const { return word_.load(std::memory_order_relaxed) >> kRoundShift; }

  // Of who calls the round. What was written before `open` is seen inside, and what was written
  // inside where `empty` is true.

  /// Begins the next round. The gate must be closed and empty.
  void open() { word_.store((round() + 1) << kRoundShift | kOpen, std::memory_order_release); }
  void close() { word_.fetch_and(~kOpen, std::memory_order_relaxed); }  // what counts is `empty`
  bool empty() const { return inside(word_.load(std::memory_order_acquire)) == 0; }

  // Of who helps. `seen`: the last round he was in.

  bool admits(std::uint64_t seen) const {
    return admits(word_.load(std::memory_order_acquire), seen);
  }
  /// True: he is inside, and `seen` is this round.
  bool enter(std::uint64_t& seen) {
    std::uint64_t now = word_.load(std::memory_order_relaxed);
    while (admits(now, seen))
      if (word_.compare_exchange_weak(now, now + 1, std::memory_order_acquire,
                                      std::memory_order_relaxed)) {
        seen = now >> kRoundShift;
        return true;
      }
    return false;
  }
  /// True: he was the last to leave a closed gate.
  bool leave() {
    const std::uint64_t now = word_.fetch_sub(1, std::memory_order_release) - 1;
    return !(now & kOpen) && inside(now) == 0;
  }

 private:
  // In one word, so that nobody enters a gate that was just closed: how many are inside, whether it
  // is open, the round.
  static constexpr int kRoundShift = 32;
  static constexpr std::uint64_t kOpen = std::uint64_t{1} << (kRoundShift - 1);

  static std::uint64_t inside(std::uint64_t word) { return word & (kOpen - 1); }
  static bool admits(std::uint64_t word, std::uint64_t seen) {
    return (word & kOpen) && word >> kRoundShift != seen;
  }

  std::atomic<std::uint64_t> word_{0};
};

}  // namespace stickslip::backend
