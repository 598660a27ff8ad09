// One contact with everything else held: v = c + G lambda, reduced to the plane v_z = 0 (docs/theory/contact.md (C5)-(C9)).
//
//   a = -c_z / G_zz,   w = G_zT / G_zz,   S = G_TT - G_Tz w^T,   b = c_T + G_Tz a
//   lambda_z = a - w . lambda_T,   v_T = S lambda_T + b
// Every single-contact method works on these. S is 2x2, so no 3x3 inverse is formed ([Hwangbo 2018] forms M = G^-1).
#pragma once
#include "lane/lane.h"

namespace stickslip::contact {

/// The 3x3 block of one contact and what is precomputed from it once per step.
template <class S>
struct LocalContact {
  S xx, xy, xz, yy, yz, zz;  // G_ii, symmetric [1/kg]
  S mu;                      // [1]
  S inv_zz;                  // 1 / G_zz [kg]; 0 where the contact cannot push
  S wx, wy;                  // [1]
  S sxx, sxy, syy;           // S [1/kg]
  S ixx, ixy, iyy;           // S^-1 [kg] (regularized by 1e-14 trace where S is singular)
  S scale;                   // trace(G_ii) / 3 = 1 / rho_i [1/kg]: turns impulses into velocities
};

}  // namespace stickslip::contact
