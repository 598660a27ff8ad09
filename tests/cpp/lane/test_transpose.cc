// Rows of an array to lanes and back, whatever their length and order.
#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "check.h"
#include "lane/lane.h"
#include "lane/transpose.h"

using namespace stickslip;

namespace {

/// Every other row of an array goes to the lanes, in any order, and comes back; the rows between
/// them stay as they are. Memory ends with the array: a sanitizer sees what reads past it.
template <class S>
void check_rows() {
  using T = Value<S>;
  constexpr int W = ScalarTraits<S>::kWidth;
  std::mt19937 random(W);
  for (int n = 1; n <= 3 * W + 2; ++n) {
    std::vector<T> array(static_cast<size_t>(2 * W * n));
    std::iota(array.begin(), array.end(), T(1));
    int rows[W];
    for (int i = 0; i < W; ++i) rows[i] = 2 * i + 1;
    std::shuffle(rows, rows + W, random);
    std::vector<S> lanes(static_cast<size_t>(n));
    load_rows(array.data(), rows, n, lanes.data());
    bool right = true;
    const auto number = [&](int row, int k) -> T& {
      return array[static_cast<size_t>(row * n + k)];
    };
    for (int k = 0; k < n; ++k)
      for (int i = 0; i < W; ++i)
        right = right && get_lane(lanes[static_cast<size_t>(k)], i) == number(rows[i], k);
    CHECK(right);

    std::vector<T> wanted = array;
    for (int k = 0; k < n; ++k)
      for (int i = 0; i < W; ++i) {
        set_lane(lanes[static_cast<size_t>(k)], i, T(-1000 * i - k));
        wanted[static_cast<size_t>(rows[i] * n + k)] = T(-1000 * i - k);
      }
    store_rows(lanes.data(), n, array.data(), rows);
    CHECK(array == wanted);
  }
}

}  // namespace

TEST(RowsInAnyOrderComeIntoLanesAndBackAndNothingElseIsTouched) {
  check_rows<double>();
  check_rows<float>();
  check_rows<Pack<double, 2>>();
  check_rows<Pack<double, 4>>();
  check_rows<Pack<float, 4>>();
  check_rows<Pack<float, 8>>();
#ifndef __SANITIZE_ADDRESS__  // wider than a register: with checks in it, minutes to compile
  check_rows<Pack<double, 8>>();
  check_rows<Pack<float, 16>>();
#endif
}
