// Our own elementary functions: the same bits for every scalar type, compiler and machine. No libm
// in a kernel.
#pragma once
#include "lane/lane.h"

namespace stickslip::inline STICKSLIP_KERNELS {

/// sin and cos of x [rad], |x| < 1e15: reduction modulo pi/2 in three parts, then minimax
/// polynomials (fdlibm's for double, Cephes' for float). Error about 1 ulp: 1.1e-16 in double, 9e-8
/// in float.
template <class S>
STICKSLIP_INLINE void sincos(S x, S& sine, S& cosine) {
  constexpr bool kFloat = sizeof(Value<S>) == 4;
  const auto c = [](double k) { return constant<S>(k); };
  const S round =
      c(kFloat ? 12582912.0
               : 6755399441055744.0);  // 1.5 * 2^23, 1.5 * 2^52: adding it rounds to an integer
  const S k = madd(x, c(0.63661977236758134308), round) - round;  // nearest multiple of pi/2
  S r, ps, pc;
  if constexpr (kFloat) {
    r = nmadd(k, c(1.5703125), x);
    r = nmadd(k, c(4.83751296997e-4), r);
    r = nmadd(k, c(7.5497899549e-8), r);
    const S z = r * r;
    ps = madd(r * z, madd(z, madd(z, c(-1.9515295891e-4), c(8.3321608736e-3)), c(-1.6666654611e-1)),
              r);
    pc = madd(z * z,
              madd(z, madd(z, c(2.443315711809948e-5), c(-1.388731625493765e-3)),
                   c(4.166664568298827e-2)),
              nmadd(z, c(0.5), c(1)));
  } else {
    r = nmadd(k, c(1.57079632673412561417), x);
    r = nmadd(k, c(6.07710050630396597660e-11), r);
    r = nmadd(k, c(2.02226624879595063154e-21), r);
    const S z = r * r;
    S a = madd(z, c(1.58962301576546568060e-10), c(-2.50507477628578072866e-8));
    a = madd(z, a, c(2.75573136213857245213e-6));
    a = madd(z, a, c(-1.98412698295895385996e-4));
    a = madd(z, a, c(8.33333333332211858878e-3));
    a = madd(z, a, c(-1.66666666666666307295e-1));
    ps = madd(r * z, a, r);
    S b = madd(z, c(-1.13585365213876817300e-11), c(2.08757008419747316778e-9));
    b = madd(z, b, c(-2.75573141792967388112e-7));
    b = madd(z, b, c(2.48015872888517045348e-5));
    b = madd(z, b, c(-1.38888888888730564116e-3));
    b = madd(z, b, c(4.16666666666665929218e-2));
    pc = madd(z * z, b, nmadd(z, c(0.5), c(1)));
  }
  // The quadrant k mod 4 in -2..2 decides which polynomial serves which function, and the signs.
  const S half = k * c(0.5);
  const auto odd = abs(half - ((half + round) - round)) > c(0.25);
  const S quadrant = nmadd(c(4), madd(k, c(0.25), round) - round, k);
  const S s = select(odd, pc, ps), q = select(odd, ps, pc);
  sine = select((quadrant < c(-0.5)) | (quadrant > c(1.5)), -s, s);
  cosine = select((quadrant > c(0.5)) | (quadrant < c(-1.5)), -q, q);
}

/// cos t and sin(t) / t from t^2. Where |t| < 1/4 from their series, which need no root, no
/// division and no quadrant: error below 7e-17 in double, 3.5e-8 in float; beyond, up to |t| = 3,
/// 4e-16 and 2e-7.
template <class S>
STICKSLIP_INLINE void cos_and_sinc(S t2, S& cosine, S& sinc) {
  const auto c = [](double k) { return constant<S>(k); };
  const S one = c(1);
  S a = madd(t2, c(1.0 / 479001600), c(-1.0 / 3628800));
  a = madd(t2, a, c(1.0 / 40320));
  a = madd(t2, a, c(-1.0 / 720));
  a = madd(t2, a, c(1.0 / 24));
  a = madd(t2, a, c(-1.0 / 2));
  cosine = madd(t2, a, one);
  S b = madd(t2, c(-1.0 / 39916800), c(1.0 / 362880));
  b = madd(t2, b, c(-1.0 / 5040));
  b = madd(t2, b, c(1.0 / 120));
  b = madd(t2, b, c(-1.0 / 6));
  sinc = madd(t2, b, one);
  const auto large = !(t2 < c(1.0 / 16));
  if (!any(large)) return;
  const S t = select(large, sqrt(t2), one);
  S s, k;
  sincos(t, s, k);
  cosine = select(large, k, cosine);
  sinc = select(large, s / t, sinc);
}

/// atan2(y, x) in (-pi, pi], double precision only: |error| below 2 ulp. atan2(0, 0) = 0.
/// Reduction to |t| < 0.66 with a single division, then the rational approximation of Cephes.
template <class S>
STICKSLIP_INLINE S atan2(S y, S x) {
  const auto c = [](double k) { return constant<S>(k); };
  const S ay = abs(y), ax = abs(x);
  const auto steep =
      ay > ax * c(2.41421356237309504880);  // tan(3 pi / 8): atan t = pi/2 + atan(-1/t)
  const auto middle = ay > ax * c(0.66);    // atan t = pi/4 + atan((t - 1) / (t + 1))
  const S top = select(steep, -ax, select(middle, ay - ax, ay));
  S bottom = select(steep, ay, select(middle, ay + ax, ax));
  bottom = select(bottom > c(0), bottom, c(1));
  const S t = top / bottom, z = t * t;
  S p = madd(z, c(-8.750608600031904122785e-1), c(-1.615753718733365076637e1));
  p = madd(z, p, c(-7.500855792314704667340e1));
  p = madd(z, p, c(-1.228866684490136173410e2));
  p = madd(z, p, c(-6.485021904942025371773e1));
  S q = z + c(2.485846490142306297962e1);
  q = madd(z, q, c(1.650270098316988542046e2));
  q = madd(z, q, c(4.328810604912902668951e2));
  q = madd(z, q, c(4.853903996359136964868e2));
  q = madd(z, q, c(1.945506571482613964425e2));
  S r = madd(t * z, p / q, t);
  // The low halves of pi/2 and pi/4 keep the last bit.
  const S high =
      select(steep, c(1.57079632679489661923), select(middle, c(0.78539816339744830962), c(0)));
  const S low =
      select(steep, c(6.123233995736765886e-17), select(middle, c(3.061616997868382943e-17), c(0)));
  r = high + (r + low);
  r = select(x < c(0), c(3.14159265358979323846) - (r - c(1.2246467991473531772e-16)), r);
  return select(y < c(0), -r, r);
}

/// acos(x) [rad], double precision only, |x| <= 1 (clipped): |error| below 4e-16.
template <class S>
STICKSLIP_INLINE S acos(S x) {
  const S one = constant<S>(1);
  const S clipped = max(min(x, one), -one);
  return constant<S>(2) * atan2(sqrt(one - clipped), sqrt(one + clipped));
}

/// Cube root of any finite double, |error| below 4 ulp: an estimate from the exponent bits, then
/// four Newton steps.
STICKSLIP_INLINE double cbrt(double x) {
  const double a = abs(x);
  if (!(a > 1e-300)) return 0;
  // Dividing the bit pattern by three divides the exponent by three; good to 5 % ("B1" of fdlibm's
  // cbrt).
  const unsigned long long bits =
      __builtin_bit_cast(unsigned long long, a) / 3 + 0x2A9F76253119D328ull;
  double r = __builtin_bit_cast(double, bits);
  for (int i = 0; i < 4; ++i) r = madd((a / (r * r) - r), 1.0 / 3.0, r);
  return x < 0 ? -r : r;
}

}  // namespace stickslip::inline STICKSLIP_KERNELS
