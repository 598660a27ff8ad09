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

/// Unit test forces at a contact point, one per row, on their way to the base: moments about the
/// base origin and forces, by columns.
template <class S>
struct TestForces {
  Row3<S> ang[3], lin[3];
};

/// Passes a joint; returns its column of Y. On a force f: z = s . f / sqrt(D), f <- f - U z.
template <class S>
STICKSLIP_INLINE Row3<S> pass_joint(const LinkState<Wide<S>>& joint, int lane, TestForces<S>& f) {
  const auto at = [&](const Wide<S>& w) { return lane_of<S>(w, lane); };
  const Spatial<Wide<S>>&s = joint.axis, &u = joint.arm;
  const Row3<S> turn =
      madd(f.ang[2], at(s.ang.z), madd(f.ang[1], at(s.ang.y), f.ang[0] * at(s.ang.x)));
  const Row3<S> slide =
      madd(f.lin[2], at(s.lin.z), madd(f.lin[1], at(s.lin.y), f.lin[0] * at(s.lin.x)));
  const Row3<S> z = (turn + slide) * at(joint.inv_root);
  f.lin[0] = nmadd(z, at(u.lin.x), f.lin[0]);
  f.lin[1] = nmadd(z, at(u.lin.y), f.lin[1]);
  f.lin[2] = nmadd(z, at(u.lin.z), f.lin[2]);
  f.ang[0] = nmadd(z, at(u.ang.x), f.ang[0]);
  f.ang[1] = nmadd(z, at(u.ang.y), f.ang[1]);
  f.ang[2] = nmadd(z, at(u.ang.z), f.ang[2]);
  return z;
}

/// The same for the first joint, where the forces of a pack are unit vectors at the point: the
/// products with their zeros and ones are left out.
template <class S>
STICKSLIP_INLINE Row3<S> pass_first_joint(const LinkState<Wide<S>>& joint, int lane,
                                          const Vec3<S>& point, TestForces<S>& f) {
  if constexpr (ScalarTraits<S>::kWidth == 1) {
    return pass_joint<S>(joint, lane, f);
  } else {
    const S one = constant<S>(1), &k = joint.inv_root;
    const Vec3<S>&a = joint.axis.ang, &l = joint.axis.lin, &n = joint.arm.ang, &u = joint.arm.lin,
          &p = point;
    const S x = (nmadd(p.y, a.z, p.z * a.y) + l.x) * k,
            y = (madd(p.x, a.z, -(p.z * a.x)) + l.y) * k,
            z = (nmadd(p.x, a.y, p.y * a.x) + l.z) * k;
    f.lin[0] = {nmadd(x, u.x, one), -(y * u.x), -(z * u.x)};
    f.lin[1] = {-(x * u.y), nmadd(y, u.y, one), -(z * u.y)};
    f.lin[2] = {-(x * u.z), -(y * u.z), nmadd(z, u.z, one)};
    f.ang[0] = {-(x * n.x), -madd(y, n.x, p.z), nmadd(z, n.x, p.y)};
    f.ang[1] = {nmadd(x, n.y, p.z), -(y * n.y), -madd(z, n.y, p.x)};
    f.ang[2] = {-madd(x, n.z, p.y), nmadd(y, n.z, p.x), -(z * n.z)};
    return {x, y, z};
  }
}

/// Takes test forces from `link` to the base.
template <class S>
STICKSLIP_INLINE void climb(const Tree<S>& t, LinkIndex link, TestForces<S>& f,
                            ContactRows<S>& rows) {
  for (; link.slot != kBaseSlot; link = t.slots[link.slot].parent[link.lane]) {
    rows.path[rows.depth] = link;
    store(pass_joint<S>(t.links[link.slot], link.lane, f), rows.joint[rows.depth++]);
  }
  Row3<S> base[6] = {f.lin[0], f.lin[1], f.lin[2], f.ang[0], f.ang[1], f.ang[2]};
  if (t.floating) solve_base_transposed(t.base, base);
#pragma GCC unroll 6
  for (int k = 0; k < 6; ++k) store(base[k], rows.base[k]);
}

/// Rows of the velocity of a point: unit forces there. `point` relative to the base origin; contact
/// axes along the world's.
template <class S>
void compute_contact_rows(const Tree<S>& t, LinkIndex link, const Vec3<S>& point,
                          ContactRows<S>& rows) {
  const S o = constant<S>(0), one = constant<S>(1);
  TestForces<S> f = {{make_row3(o, -point.z, point.y), make_row3(point.z, o, -point.x),
                      make_row3(-point.y, point.x, o)},
                     {make_row3(one, o, o), make_row3(o, one, o), make_row3(o, o, one)}};
  rows.depth = 0;
  if (link.slot != kBaseSlot) {
    rows.path[rows.depth] = link;
    store(pass_first_joint(t.links[link.slot], link.lane, point, f), rows.joint[rows.depth++]);
    link = t.slots[link.slot].parent[link.lane];
  }
  climb(t, link, f, rows);
}

/// Rows of the angular velocity of a link: unit moments along the world's axes.
template <class S>
void compute_angular_rows(const Tree<S>& t, LinkIndex link, ContactRows<S>& rows) {
  const S o = constant<S>(0), one = constant<S>(1);
  const Row3<S> none = make_row3(o, o, o);
  TestForces<S> f = {{make_row3(one, o, o), make_row3(o, one, o), make_row3(o, o, one)},
                     {none, none, none}};
  rows.depth = 0;
  climb(t, link, f, rows);
}

/// Column of the velocity of a point at `arm` from the one that `linear` is of, on the same link.
template <class S>
STICKSLIP_INLINE Row3<S> at_point(const Row3<S>& linear, const Row3<S>& angular,
                                  const Vec3<S>& arm) {
  S v[3], w[3];
  store(linear, v);
  store(angular, w);
  const Vec3<S> at = cross(Vec3<S>{w[0], w[1], w[2]}, arm, Vec3<S>{v[0], v[1], v[2]});
  return make_row3(at.x, at.y, at.z);
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
