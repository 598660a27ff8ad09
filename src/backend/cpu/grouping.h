// Which environment is in which lane. Environments that touch the ground with the same points share
// packs: a pack computes every contact that one of its lanes has, and sweeps until its slowest lane
// is done (docs/theory/batch.md, section 9). Shows in no bit.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "world/aligned_block.h"

namespace stickslip::backend {

/// An array of numbers that environments carry with them, lane by lane: (packs, numbers, width).
struct LaneRows {
  char* data;
  long numbers;
  int number_bytes;
};

/// Where number k of the environment at `place` is in such an array.
inline long number_at(long place, long k, long numbers, int width) {
  return (place / width * numbers + k) * width + place % width;
}

/// Place p is lane p % width of pack p / width. Environments change places within a block of
/// places, so that what a pack loads stays near; those that fill up the last pack stay.
class Grouping {
 public:
  static constexpr int kBlock = 256;

  /// `every`: steps between regroupings, at least, and more while they move few environments; 0:
  /// never. Without `points` there is nothing to tell environments apart.
  Grouping(long num_envs, long padded, int width, int points, int every);

  /// The environment at each place.
  const int* order() const { return order_; }
  long place(long env) const { return places_[env]; }
  std::size_t bytes() const { return order_block_.bytes() + places_block_.bytes(); }

  bool due() const { return interval_ > 0 && steps_ >= interval_; }
  /// How many of these steps to take before asking again whether it is due.
  int part_of(int steps) const;
  void count(int steps) { steps_ += steps; }

  /// All blocks are to be regrouped, each once, then `restart`.
  long blocks() const { return (num_envs_ + kBlock - 1) / kBlock; }
  void restart();
  /// Of several blocks at the same time. `active`: flags (environments, points). `carried` moves
  /// along.
  void regroup(long block, const std::uint8_t* active, std::span<const LaneRows> carried);

 private:
  void exchange(long a, long b, std::span<const LaneRows> carried);

  const long num_envs_;
  const int width_, points_;
  const long every_;
  long interval_;                // to the next regrouping
  long steps_ = 0;               // since the last one
  std::atomic<long> moved_ = 0;  // exchanges, by the one under way
  world::AlignedBlock order_block_, places_block_;
  int *order_, *places_;
};

}  // namespace stickslip::backend
