// Nanoseconds per environment that the arrays of a batch cost at the edge of a step call, by layout
// (docs/design/009-batch-arrays.md). ANYmal in float: q, u, forces and targets in, q, u and
// impulses out, 140 numbers.
//
// Usage: bench_batch_arrays
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <numeric>
#include <random>
#include <vector>

#include "lane/transpose.h"

using namespace stickslip;

namespace {

#ifdef __AVX512F__
constexpr int kWidth = 16;
#else
constexpr int kWidth = 8;
#endif
constexpr int kIn[] = {19, 18, 18, 12}, kOut[] = {19, 18, 36}, kMost = 36, kRounds = 31;
using Lanes = Pack<float, kWidth>;

enum class Layout { kRows, kRowsInAnyOrder, kColumns, kPacks };

/// CPU seconds of this thread: other programs on the machine do not count.
double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// `n` numbers of a pack's environments, from or to an array of `envs` environments.
void move(Layout layout, bool in, float* array, int n, long first, long envs, Lanes* lanes,
          const int* rows) {
  if (layout == Layout::kRows || layout == Layout::kRowsInAnyOrder) {
    in ? load_rows(array, rows, n, lanes) : store_rows(lanes, n, array, rows);
  } else {
    const long stride = layout == Layout::kColumns ? envs : kWidth;
    float* at = array + (layout == Layout::kColumns ? first : first * n);
    for (int k = 0; k < n; ++k, at += stride) {
      asm volatile("" : "+r"(at));  // no call of memcpy for whole blocks
      in ? std::memcpy(&lanes[k], at, sizeof(Lanes)) : std::memcpy(at, &lanes[k], sizeof(Lanes));
    }
  }
}

/// An array as a batch has it: on a cache line.
using Array = std::unique_ptr<float[], decltype(&std::free)>;
Array array_of(long numbers) {
  const long bytes = numbers * long(sizeof(float)) / 64 * 64 + 64;
  Array array(static_cast<float*>(std::aligned_alloc(64, bytes)), std::free);
  std::fill(array.get(), array.get() + numbers, 0.5f);
  return array;
}

/// Median over rounds.
double measure(Layout layout, long envs) {
  std::vector<Array> arrays;
  for (const int n : kIn) arrays.push_back(array_of(n * envs));
  for (const int n : kOut) arrays.push_back(array_of(n * envs));
  // In any order within blocks, as environments are regrouped.
  constexpr long kBlock = 256;
  std::vector<int> order(envs);
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 random(1);
  for (long k = 0; k < envs && layout == Layout::kRowsInAnyOrder; k += kBlock)
    std::shuffle(order.begin() + k, order.begin() + std::min(k + kBlock, envs), random);
  Lanes lanes[kMost];
  const long calls = std::max(1l, 65536 / envs);
  std::vector<double> rounds;
  for (int round = 0; round < kRounds; ++round) {
    const double start = thread_seconds();
    for (long call = 0; call < calls; ++call)
      for (long first = 0; first < envs; first += kWidth) {
        int a = 0;
        const int* rows = &order[first];
        for (const int n : kIn) move(layout, true, arrays[a++].get(), n, first, envs, lanes, rows);
        for (const int n : kOut)
          move(layout, false, arrays[a++].get(), n, first, envs, lanes, rows);
      }
    rounds.push_back((thread_seconds() - start) * 1e9 / double(calls * envs));
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds[kRounds / 2];
}

}  // namespace

int main() {
  std::printf("%d lanes, ns per environment and call:\n", kWidth);
  std::printf("environments   (envs, n) turned   in any order   (n, envs)   (packs, n, lanes)\n");
  for (const long envs : {16l, 1024l, 4096l, 4112l, 65536l})
    std::printf("%12ld %18.1f %14.1f %11.1f %19.1f\n", envs, measure(Layout::kRows, envs),
                measure(Layout::kRowsInAnyOrder, envs), measure(Layout::kColumns, envs),
                measure(Layout::kPacks, envs));
}
