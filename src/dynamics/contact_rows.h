// Rows Y = J L^-1 of one contact point, three at a time, climbing from the link to the base. No
// dense J, no M^-1: G_ij = Y_i Y_j^T, and two points share only the joints above both
// (docs/theory/dynamics.md (D16)-(D18)).
#pragma once
#include "dynamics/solve.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Y of one contact: `joint[k]` is the column of the joint at `path[k]`, from the link to the base.
template <class S>
struct ContactRows {
  int depth;
  LinkIndex* path;  // capacity: deepest joint of the tree
  Row3<S>* joint;   // same capacity
  Row3<S>* base;    // columns of the base (6), order of u
};

/// `point` relative to the base origin; contact axes along the world's.
template <class S>
void compute_contact_rows(const Tree<S>& t, LinkIndex link, const Vec3<S>& point,
                          ContactRows<S>& rows) {
  const S o = constant<S>(0), one = constant<S>(1);
  // Unit test forces at the point, one per row: [0..2] force, [3..5] moment about the base origin.
  Row3<S> f[6] = {make_row3(one, o, o),
                  make_row3(o, one, o),
                  make_row3(o, o, one),
                  make_row3(o, -point.z, point.y),
                  make_row3(point.z, o, -point.x),
                  make_row3(-point.y, point.x, o)};
  rows.depth = 0;
  while (link.slot != kBaseSlot) {
    const auto& state = t.links[link.slot];
    const auto at = [&](const Wide<S>& w) { return lane_of<S>(w, link.lane); };
    const Spatial<Wide<S>>&s = state.axis, &u = state.arm;
    const Row3<S> turn = madd(f[5], at(s.ang.z), madd(f[4], at(s.ang.y), f[3] * at(s.ang.x)));
    const Row3<S> slide = madd(f[2], at(s.lin.z), madd(f[1], at(s.lin.y), f[0] * at(s.lin.x)));
    const Row3<S> z = (turn + slide) * at(state.inv_root);
    f[0] = nmadd(z, at(u.lin.x), f[0]);
    f[1] = nmadd(z, at(u.lin.y), f[1]);
    f[2] = nmadd(z, at(u.lin.z), f[2]);
    f[3] = nmadd(z, at(u.ang.x), f[3]);
    f[4] = nmadd(z, at(u.ang.y), f[4]);
    f[5] = nmadd(z, at(u.ang.z), f[5]);
    rows.path[rows.depth] = link;
    rows.joint[rows.depth++] = z;
    link = t.slots[link.slot].parent[link.lane];
  }
  if (t.floating) solve_base_transposed(t.base, f);
  for (int k = 0; k < 6; ++k) rows.base[k] = f[k];
}

/// One row Y = J L^-1: the unit force `axis` at `point`. Calls put_joint(link, entry) for the
/// joints from the link to the base and returns the six base entries in `base`.
template <class S, class F>
STICKSLIP_INLINE void compute_row(const Tree<S>& t, LinkIndex link, const Vec3<S>& point,
                                  const Vec3<S>& axis, S base[6], F&& put_joint) {
  Spatial<S> f{cross(point, axis), axis};
  while (link.slot != kBaseSlot) {
    const Spatial<S> s = field_of<S, Spatial>(t, link, &LinkState<Wide<S>>::axis);
    const Spatial<S> u = field_of<S, Spatial>(t, link, &LinkState<Wide<S>>::arm);
    const S z = dot(s, f) * lane_of<S>(t.links[link.slot].inv_root, link.lane);
    f = nmadd(u, z, f);
    put_joint(link, z);
    link = t.slots[link.slot].parent[link.lane];
  }
  to_rows(f, base);
  if (t.floating) solve_base_transposed(t.base, base);
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
