// Rows Y = J L^-1 of one contact point, three at a time, climbing from the link to the base. No
// dense J, no M^-1: G_ij = Y_i Y_j^T, and two points share only the joints above both
// (docs/theory/dynamics.md (D16)-(D18)).
#pragma once
#include "dynamics/solve.h"

namespace stickslip::dynamics {

/// Y of one contact: `joint[k]` is the column of the joint at `path[k]`, from the link to the base.
template <class S>
struct ContactRows {
  int depth;
  LinkIndex* path;  // capacity: deepest joint of the tree
  Row3<S>* joint;   // same capacity
  Row3<S> base[6];  // columns of the base, order of u
};

/// `point` relative to the base origin; rows of `frame` are the contact axes x, y, z in world axes.
template <class S>
void compute_contact_rows(const Tree<S>& t, LinkIndex link, const Vec3<S>& point,
                          const Mat3<S>& frame, ContactRows<S>& rows) {
  const S* e = frame.m;
  const Vec3<S> ex{e[0], e[1], e[2]}, ey{e[3], e[4], e[5]}, ez{e[6], e[7], e[8]};
  const Vec3<S> mx = cross(point, ex), my = cross(point, ey), mz = cross(point, ez);
  // Unit test forces at the point, one per row: [0..2] force, [3..5] moment about the base origin.
  Row3<S> f[6] = {make_row3(ex.x, ey.x, ez.x), make_row3(ex.y, ey.y, ez.y),
                  make_row3(ex.z, ey.z, ez.z), make_row3(mx.x, my.x, mz.x),
                  make_row3(mx.y, my.y, mz.y), make_row3(mx.z, my.z, mz.z)};
  rows.depth = 0;
  while (link.slot != kBaseSlot) {
    const auto& state = t.links[link.slot];
    const auto at = [&](const Wide<S>& w) { return lane_of<S>(w, link.lane); };
    const Spatial<Wide<S>>&s = state.axis, &u = state.arm;
    Row3<S> z = f[3] * at(s.ang.x);
    z = madd(f[4], at(s.ang.y), z);
    z = madd(f[5], at(s.ang.z), z);
    z = madd(f[0], at(s.lin.x), z);
    z = madd(f[1], at(s.lin.y), z);
    z = madd(f[2], at(s.lin.z), z);
    z = z * at(state.inv_root);
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
  for (int k = 0; k < 6; ++k) rows.base[k] = f[k];
  if (t.floating) solve_base_transposed(t.base, rows.base);
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

}  // namespace stickslip::dynamics
