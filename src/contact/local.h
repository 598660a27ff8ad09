// One contact with everything else held: v = c + G lambda, reduced to the plane v_z = 0
// (docs/theory/contact.md (C5)-(C9)).
//
//   a = -c_z / G_zz,   w = G_zT / G_zz,   S = G_TT - G_Tz w^T,   b = c_T + G_Tz a
//   lambda_z = a - w . lambda_T,   v_T = S lambda_T + b
// Every single-contact method works on these. S is 2x2, so no 3x3 inverse is formed ([Hwangbo 2018]
// forms M = G^-1).
#pragma once
#include "lane/lane.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// The 3x3 block of one contact and what is precomputed from it once per step. Fill the block and
/// mu, then `prepare`.
template <class S>
struct LocalContact {
  S xx, xy, xz, yy, yz, zz;  // G_ii, symmetric [1/kg]
  S mu;                      // [1]
  S inv_zz;                  // 1 / G_zz [kg]; 0 where the contact cannot push
  S wx, wy;                  // [1]
  S sxx, sxy, syy;           // S [1/kg]
  S ixx, ixy, iyy;           // S^-1 [kg]; the pseudo-inverse where S is singular
  S scale;                   // trace(G_ii) / 3 = 1 / rho_i [1/kg]: turns impulses into velocities
};

/// Friction above this counts as this: beyond, the rounding of v_T times mu would fill the
/// residual.
inline constexpr double kMaxFriction = 1e4;

/// Relative size below which an eigenvalue of a block counts as zero.
template <class S>
STICKSLIP_INLINE constexpr double singular_threshold() {
  return sizeof(Value<S>) == 4 ? 1e-5 : 1e-12;
}

/// Everything but the block and mu. A contact that cannot push (G_zz = 0: its body is held along
/// the normal) gets inv_zz = 0 and never closes. Where S has rank one (a hinge that moves its tip
/// along one line) S^-1 is S / trace(S)^2, the pseudo-inverse: the stick impulse of least norm,
/// without the noise that a small regularization amplifies.
template <class S>
STICKSLIP_INLINE void prepare(LocalContact<S>& k) {
  const S zero = constant<S>(0), one = constant<S>(1), eps = constant<S>(singular_threshold<S>());
  const S trace = k.xx + k.yy + k.zz;
  k.scale = trace * constant<S>(1.0 / 3.0);
  const auto pushes = k.zz > eps * trace;
  k.inv_zz = select(pushes, one / select(pushes, k.zz, one), zero);
  k.wx = k.xz * k.inv_zz;
  k.wy = k.yz * k.inv_zz;
  k.sxx = nmadd(k.xz, k.wx, k.xx);
  k.sxy = nmadd(k.xz, k.wy, k.xy);
  k.syy = nmadd(k.yz, k.wy, k.yy);
  const S det = nmadd(k.sxy, k.sxy, k.sxx * k.syy), tr = k.sxx + k.syy;
  // The rounding of S is relative to G_TT, not to S. Where S vanishes, it leaves a trace of either
  // sign, so a determinant counts only next to a trace.
  const auto some = tr > eps * trace;
  const auto full = some & (det > eps * tr * (k.xx + k.yy));
  const S inv = one / select(full, det, select(some, tr * tr, one));
  const S inverse = select(full | some, inv, zero);
  k.ixx = select(full, k.syy, k.sxx) * inverse;
  k.ixy = select(full, -k.sxy, k.sxy) * inverse;
  k.iyy = select(full, k.sxx, k.syy) * inverse;
}

/// The reduced problem for one contact velocity c (without the contact's own impulse), and which
/// regime it is in. Exactly one of open (neither mask), `stick`, `slip` holds per lane.
template <class S>
struct Reduced {
  S a;        // normal impulse at lambda_T = 0 [N s]
  S bx, by;   // tangential velocity at lambda_T = 0, v_z = 0 [m/s]
  S x, y, z;  // the impulse that stops the contact [N s]; only where it closes
  Mask<S> stick, slip;
};

/// [Hwangbo 2018] eq. 6-8: open where c_z >= 0 (then lambda = 0), stick where the stopping impulse
/// is in the cone.
template <class S>
STICKSLIP_INLINE Reduced<S> reduce(const LocalContact<S>& k, S cx, S cy, S cz) {
  Reduced<S> r;
  const S zero = constant<S>(0);
  r.a = -cz * k.inv_zz;
  r.bx = madd(k.xz, r.a, cx);
  r.by = madd(k.yz, r.a, cy);
  r.x = -madd(k.ixx, r.bx, k.ixy * r.by);
  r.y = -madd(k.ixy, r.bx, k.iyy * r.by);
  r.z = nmadd(k.wx, r.x, nmadd(k.wy, r.y, r.a));
  const S limit = k.mu * r.z;
  const auto closing = (cz < zero) & (k.inv_zz > zero);
  // lambda_z >= 0 has to be tested apart: with mu |z| alone a pulling impulse passes.
  const auto inside = (r.z >= zero) & (madd(r.x, r.x, r.y * r.y) <= limit * limit);
  r.stick = closing & inside;
  r.slip = closing & !inside;
  return r;
}

/// Velocity change of an impulse change through the contact's own block: G_ii d [m/s].
template <class S>
STICKSLIP_INLINE void apply_block(const LocalContact<S>& k, const S d[3], S out[3]) {
  out[0] = madd(k.xx, d[0], madd(k.xy, d[1], k.xz * d[2]));
  out[1] = madd(k.xy, d[0], madd(k.yy, d[1], k.yz * d[2]));
  out[2] = madd(k.xz, d[0], madd(k.yz, d[1], k.zz * d[2]));
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
