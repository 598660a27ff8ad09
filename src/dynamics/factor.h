// M = L^T L from the tips to the base. L is never written out: its row of joint i is
//   L_ij = U_i . s_j (ancestors j),  L_ii = sqrt(D_i),  U_i = I_A s_i / sqrt(D_i),  D_i = s_i . I_A
//   s_i,
// with I_A the articulated-body inertia [Featherstone 2008, sec. 6.5, 7.2]. All U_i are forces at
// the base origin, so a row costs six numbers however deep the tree is. Why not the parent array:
// docs/design/003-articulated-factor.md. Proof: docs/theory/dynamics.md (D7)-(D10).
#pragma once
#include "dynamics/walk.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Factors M + diag(extra). `extra` (num_joints): joint-space diagonal terms, such as implicit
/// damping; may be null.
template <class S>
void factor_mass_matrix(Tree<S>& t, const S* extra) {
  WalkInput<S> in;
  in.diagonal = extra;
  walk<kFactor>(t, in);
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
