// The certificate of a contact: De Saxce's natural map in velocity units (docs/theory/contact.md
// (C3)).
//
//   u = v + mu |v_T| z,   e = |scale lambda - P_K(scale lambda - u)|,   K the Coulomb cone, scale =
//   trace(G_ii) / 3
// It is zero exactly where Signorini's condition and Coulomb's law hold. The projection is
// homogeneous, so the usual |lambda - P_K(lambda - rho u)| / rho with rho = 1 / scale is this,
// without a division by a block that may be zero.
#pragma once
#include "contact/local.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Squared natural-map residual of one contact [m^2/s^2] from its velocity [m/s] and impulse [N s].
/// Pure.
template <class S>
STICKSLIP_INLINE S natural_map_residual_squared(const LocalContact<S>& k, const S v[3],
                                                const S lambda[3]) {
  const S zero = constant<S>(0), one = constant<S>(1);
  const S speed = sqrt(madd(v[0], v[0], v[1] * v[1]));
  const S lx = k.scale * lambda[0], ly = k.scale * lambda[1], lz = k.scale * lambda[2];
  const S x = lx - v[0], y = ly - v[1], z = lz - madd(k.mu, speed, v[2]);
  const S norm = sqrt(madd(x, x, y * y));
  // Projection on the cone: inside, in the polar cone, or on the mantle, there at height `along`
  // and with f times the tangential part: two quotients by one division.
  const auto inside = (norm <= k.mu * z) & (z >= zero);  // z apart: without friction mu z = 0
  const auto polar = k.mu * norm <= -z;
  const auto off_axis = norm > zero;
  const S length = select(off_axis, norm, one);
  const S part = madd(k.mu, norm, z) / (madd(k.mu, k.mu, one) * length);
  const S along = part * length, f = k.mu * part;
  const S px = select(inside, x, select(polar, zero, f * x));
  const S py = select(inside, y, select(polar, zero, f * y));
  const S pz = select(inside, z, select(polar, zero, along));
  const S dx = lx - px, dy = ly - py, dz = lz - pz;
  return madd(dx, dx, madd(dy, dy, dz * dz));
}

/// The same, not squared [m/s].
template <class S>
STICKSLIP_INLINE S natural_map_residual(const LocalContact<S>& k, const S v[3], const S lambda[3]) {
  return sqrt(natural_map_residual_squared(k, v, lambda));
}

/// What the rounding of an impulse may hide of a velocity [m/s]: an impulse so large that the
/// velocity drowns in its rounding certifies nothing. Part of every residual.
template <class S>
STICKSLIP_INLINE S impulse_rounding(const LocalContact<S>& k, const S lambda[3]) {
  const S eps = constant<S>(sizeof(Value<S>) == 4 ? 2e-7 : 4e-16);
  return eps * k.scale * (abs(lambda[0]) + abs(lambda[1]) + abs(lambda[2]));
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
