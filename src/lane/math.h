// Our own elementary functions: the same bits for every scalar type, compiler and machine. No libm in a kernel.
#pragma once
#include "lane/lane.h"

namespace stickslip {

/// sin and cos of x [rad], |x| < 1e5: reduction modulo pi/2 in three parts, then minimax polynomials (fdlibm's for
/// double, Cephes' for float). Error about 1 ulp: 1.1e-16 in double, 9e-8 in float.
template <class S>
STICKSLIP_INLINE void sincos(S x, S& sine, S& cosine) {
  constexpr bool kFloat = sizeof(Value<S>) == 4;
  const auto c = [](double k) { return constant<S>(k); };
  const S round = c(kFloat ? 12582912.0 : 6755399441055744.0);  // 1.5 * 2^23, 1.5 * 2^52: adding it rounds to an integer
  const S k = madd(x, c(0.63661977236758134308), round) - round;  // nearest multiple of pi/2
  S r, ps, pc;
  if constexpr (kFloat) {
    r = nmadd(k, c(1.5703125), x);
    r = nmadd(k, c(4.83751296997e-4), r);
    r = nmadd(k, c(7.5497899549e-8), r);
    const S z = r * r;
    ps = madd(r * z, madd(z, madd(z, c(-1.9515295891e-4), c(8.3321608736e-3)), c(-1.6666654611e-1)), r);
    pc = madd(z * z, madd(z, madd(z, c(2.443315711809948e-5), c(-1.388731625493765e-3)), c(4.166664568298827e-2)),
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

}  // namespace stickslip
