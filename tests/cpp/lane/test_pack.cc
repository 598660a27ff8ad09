// Every operation of a pack gives each lane the bits of the plain scalar, NaN, infinities,
// denormals and zeros of either sign included.
#include "check.h"
#include "lane/math.h"
#include "lane/pack.h"

namespace stickslip {
namespace {

/// NaN may have any payload and sign: which operand's is handed on is up to the instruction.
template <class T>
bool same(T a, T b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (a != a && b != b);
}

template <class T>
std::vector<T> samples() {
  const T small = sizeof(T) == 4 ? T(1e-40) : T(1e-310), huge = sizeof(T) == 4 ? T(3e38) : T(1e308);
  std::vector<T> x = {T(0),  T(1),     T(1.5), T(0.1),  T(3e-7),  T(123456789),
                      small, T(1) / 3, huge,   T(1e20), INFINITY, NAN};
  for (size_t i = 0, n = x.size(); i < n; ++i) x.push_back(-x[i]);
  return x;
}

/// Calls f(pack, pack, scalars, scalars) with every pair of samples in every lane.
template <class T, int W, class F>
void for_pairs(F f) {
  const std::vector<T> x = samples<T>();
  const size_t n = x.size();
  for (size_t i = 0; i < n; ++i)
    for (size_t shift = 0; shift < n; ++shift) {
      Pack<T, W> a, b;
      T p[W], q[W];
      for (int l = 0; l < W; ++l) {
        p[l] = x[(i + l) % n], q[l] = x[(i + l + shift) % n];
        set_lane(a, l, p[l]), set_lane(b, l, q[l]);
      }
      f(a, b, p, q);
    }
}

template <class T, int W>
void check_arithmetic() {
  using P = Pack<T, W>;
  long wrong = 0;
  for_pairs<T, W>([&](P a, P b, const T* p, const T* q) {
    P sum = a;
    sum += b;
    const P c(T(0.7));
    P r[] = {a + b,
             a - b,
             a * b,
             a / b,
             -a,
             sum,
             sqrt(a),
             abs(a),
             min(a, b),
             max(a, b),
             madd(a, b, c),
             nmadd(a, b, c),
             constant<P>(-0.0),
             P(p[0])};
    for (int l = 0; l < W; ++l) {
      const T x = p[l], y = q[l];
      const T s[] = {x + y,
                     x - y,
                     x * y,
                     x / y,
                     -x,
                     x + y,
                     sqrt(x),
                     abs(x),
                     min(x, y),
                     max(x, y),
                     madd(x, y, T(0.7)),
                     nmadd(x, y, T(0.7)),
                     T(-0.0),
                     p[0]};
      for (size_t k = 0; k < sizeof r / sizeof *r; ++k) wrong += !same(get_lane(r[k], l), s[k]);
    }
  });
  CHECK(wrong == 0);
}

template <class T, int W>
void check_masks() {
  using P = Pack<T, W>;
  long wrong = 0;
  for_pairs<T, W>([&](P a, P b, const T* p, const T* q) {
    const auto less = a<b, positive = b> constant<P>(0);
    const Mask<P> m[] = {less,  a <= b,          a > b,           a >= b,
                         !less, less & positive, less | positive, !(less | positive)};
    bool some[8] = {}, every[8];
    for (bool& e : every) e = true;
    for (int l = 0; l < W; ++l) {
      const T x = p[l], y = q[l];
      const bool t[] = {x<y, x <= y, x> y, x >= y,         !(x < y),
                        x < y && y > 0,    x < y || y > 0, !(x < y || y > 0)};
      for (int k = 0; k < 8; ++k) {
        wrong += get_lane(m[k], l) != t[k];
        wrong += !same(get_lane(select(m[k], a, b), l), t[k] ? x : y);
        some[k] = some[k] || t[k], every[k] = every[k] && t[k];
      }
    }
    for (int k = 0; k < 8; ++k) wrong += any(m[k]) != some[k], wrong += all(m[k]) != every[k];
  });
  CHECK(wrong == 0);
}

template <class T, int W>
void check_functions() {
  long wrong = 0;
  for (int i = 0; i < 3000; ++i) {
    Pack<T, W> x, s, c;
    for (int l = 0; l < W; ++l) set_lane(x, l, T(0.01 * (i - 1500) * (l + 1)));
    sincos(x, s, c);
    for (int l = 0; l < W; ++l) {
      T p, q;
      sincos(get_lane(x, l), p, q);
      wrong += !same(get_lane(s, l), p), wrong += !same(get_lane(c, l), q);
      if constexpr (sizeof(T) == 8)
        wrong += !same(get_lane(atan2(s, x), l), atan2(p, get_lane(x, l)));
    }
  }
  CHECK(wrong == 0);
}

template <template <class, int> class F>
void for_all_packs() {
  F<double, 2>{}(), F<double, 4>{}(), F<double, 8>{}();
  F<float, 4>{}(), F<float, 8>{}(), F<float, 16>{}();
}
template <class T, int W>
struct Arithmetic {
  void operator()() const { check_arithmetic<T, W>(); }
};
template <class T, int W>
struct Masks {
  void operator()() const { check_masks<T, W>(); }
};
template <class T, int W>
struct Functions {
  void operator()() const { check_functions<T, W>(); }
};

}  // namespace

TEST(LanesCalculateLikeTheScalar) { for_all_packs<Arithmetic>(); }
TEST(LanesCompareAndSelectLikeTheScalar) { for_all_packs<Masks>(); }
TEST(OurFunctionsGiveLanesTheScalarsBits) { for_all_packs<Functions>(); }

TEST(AMagnitudeHasNoSign) {
  CHECK(!std::signbit(abs(-0.0)) && !std::signbit(abs(-0.0f)));
  CHECK(!std::signbit(get_lane(abs(constant<Pack<double, 4>>(-0.0)), 1)));
}

}  // namespace stickslip
