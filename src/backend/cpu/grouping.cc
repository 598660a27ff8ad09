#include "backend/cpu/grouping.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <numeric>

namespace stickslip::backend {
namespace {

/// Equal for equal sets of points; near keys are of sets that differ in few: the rank of the flags
/// as a Gray code. Of more than 64 points neighbors share a bit.
std::uint64_t key_of(const std::uint8_t* active, int points) {
  std::uint64_t key = 0;
  const long most = std::max(points, 64);
  for (int k = 0; k < points; ++k) key |= std::uint64_t{active[k] != 0} << (64 * k / most);
  for (int shift = 1; shift < 64; shift *= 2) key ^= key >> shift;
  return key;
}

struct Candidate {
  std::uint64_t key;
  int place, env;
  bool operator<(const Candidate& o) const { return key != o.key ? key < o.key : place < o.place; }
};

}  // namespace

Grouping::Grouping(long num_envs, long padded, int width, int points, int every)
    : num_envs_(num_envs),
      width_(width),
      points_(points),
      every_(width > 1 && num_envs > width && points > 0 ? every : 0),
      interval_(every_),
      order_block_(padded * sizeof(int)),
      places_block_(padded * sizeof(int)),
      order_(reinterpret_cast<int*>(order_block_.data())),
      places_(reinterpret_cast<int*>(places_block_.data())) {
  assert(kBlock % width == 0);  // packs belong to one block
  std::iota(order_, order_ + padded, 0);
  std::iota(places_, places_ + padded, 0);
}

int Grouping::part_of(int steps) const {
  // A short rest is taken along: every part costs a load and a store.
  return interval_ > 0 && steps >= 2 * interval_ ? static_cast<int>(interval_) : steps;
}

void Grouping::restart() {
  constexpr long kFew = 16, kLongest = 16;
  const bool few = moved_ * kFew < num_envs_;
  interval_ = few ? std::min(2 * interval_, kLongest * every_) : every_;
  moved_ = 0;
  steps_ = 0;
}

void Grouping::regroup(long block, const std::uint8_t* active, std::span<const LaneRows> carried) {
  const long first = block * kBlock, n = std::min<long>(kBlock, num_envs_ - first);
  std::array<Candidate, kBlock> sorted;
  for (long k = 0; k < n; ++k) {
    const int env = order_[first + k];
    sorted[k] = {key_of(active + long{env} * points_, points_), static_cast<int>(first + k), env};
  }
  std::sort(sorted.begin(), sorted.begin() + n);
  // Who is in the right pack already keeps its lane.
  std::array<int, kBlock> wanted;
  wanted.fill(-1);
  const auto pack_of = [&](long k) { return k / width_; };
  for (long k = 0; k < n; ++k)
    if (const long now = sorted[k].place - first; pack_of(now) == pack_of(k))
      wanted[now] = sorted[k].env;
  for (long k = 0, free = 0; k < n; ++k) {
    if (pack_of(sorted[k].place - first) == pack_of(k)) continue;
    free = std::max(free, pack_of(k) * width_);
    while (wanted[free] >= 0) ++free;
    wanted[free] = sorted[k].env;
  }
  long moved = 0;
  for (long k = 0; k < n; ++k) {
    if (order_[first + k] == wanted[k]) continue;
    exchange(first + k, places_[wanted[k]], carried);
    ++moved;
  }
  moved_ += moved;
}

void Grouping::exchange(long a, long b, std::span<const LaneRows> carried) {
  std::swap(order_[a], order_[b]);
  places_[order_[a]] = static_cast<int>(a);
  places_[order_[b]] = static_cast<int>(b);
  for (const LaneRows& rows : carried) {
    const auto at = [&](long place) {
      return rows.data + number_at(place, 0, rows.numbers, width_) * rows.number_bytes;
    };
    const auto swap_all = [&]<class T>(T) {
      T *x = reinterpret_cast<T*>(at(a)), *y = reinterpret_cast<T*>(at(b));
      for (long k = 0; k < rows.numbers; ++k) std::swap(x[k * width_], y[k * width_]);
    };
    if (rows.number_bytes == 4)
      swap_all(float{});
    else
      swap_all(double{});
  }
}

}  // namespace stickslip::backend
