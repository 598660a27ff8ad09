// The Newton step of newton.h where bodies are in contact at several points: the contacts of a body
// become one response of six numbers, and dofs that are a body's own leave it one by one, as joints
// leave an articulated inertia (docs/theory/solvers.md (C33a), (C33b)).
//
//   Q = sum T_i^T N_i T_i,  q = sum T_i^T g_i,   T_i = [1, -d_i x]
//   past an own dof with column s:  Q <- Q - Q s s^T Q / (1 + s^T Q s),  q <- q - Q s s^T q / (...)
// Pivots are those of the matrix over all dofs, but four points on a sole with six own joints enter
// it with 6 x 6 numbers once instead of 12 x 12 four times.
#pragma once
#include "contact/newton.h"
#include "spatial/vec3.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Adds N and g of a contact, in the lanes where the body has several: to Q and q.
template <class S>
STICKSLIP_INLINE void add_response(ContactBody<S>& b, const FactoredContact<S>& c) {
  const bool everywhere = all(b.several);
  const auto vector = [&](const Row3<S>& row) STICKSLIP_LAMBDA -> Vec3<S> {
    S v[3];
    store(everywhere ? row : row_where(b.several, row), v);
    return {v[0], v[1], v[2]};
  };
  const Vec3<S> arm = {c.arm[0], c.arm[1], c.arm[2]};
  const auto add = [&](int column, const Vec3<S>& n) STICKSLIP_LAMBDA {
    const auto at = [&](int r) STICKSLIP_LAMBDA -> S& { return b.response[r][column]; };
    const Vec3<S> moment = cross(arm, n, Vec3<S>{at(3), at(4), at(5)});
    at(0) = at(0) + n.x, at(1) = at(1) + n.y, at(2) = at(2) + n.z;
    at(3) = moment.x, at(4) = moment.y, at(5) = moment.z;
  };
  const Vec3<S> x = vector(c.n_columns[0]), y = vector(c.n_columns[1]), z = vector(c.n_columns[2]);
  add(0, x), add(1, y), add(2, z);
  // N (axis x arm)
  add(3, nmadd(y, arm.z, z * arm.y));
  add(4, nmadd(z, arm.x, x * arm.z));
  add(5, nmadd(x, arm.y, y * arm.x));
  const Vec3<S> g = vector(make_row3(c.n_offset[0], c.n_offset[1], c.n_offset[2]));
  S* q = b.offset;
  const Vec3<S> moment = cross(arm, g, Vec3<S>{q[3], q[4], q[5]});
  q[0] = q[0] + g.x, q[1] = q[1] + g.y, q[2] = q[2] + g.z;
  q[3] = moment.x, q[4] = moment.y, q[5] = moment.z;
}

/// Hands Q and q past the body's own dofs, from the last to the first.
template <class S>
STICKSLIP_STAGE void pass_own_dofs(ContactBody<S>& b) {
  for (int k = b.own_count() - 1; k >= 0; --k) {
    const S* s = b.own_column(k);
    // Q s and s^T Q. Two chains each where the next joint would wait for one.
    S left[6], right[6];
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) {
      const S* q = b.response[i];
      const S even = madd(q[4], s[4], madd(q[2], s[2], q[0] * s[0]));
      const S odd = madd(q[5], s[5], madd(q[3], s[3], q[1] * s[1]));
      left[i] = even + odd;
#pragma GCC unroll 6
      for (int j = 0; j < 6; ++j) right[j] = i > 0 ? madd(q[j], s[i], right[j]) : q[j] * s[0];
    }
    const S even = madd(left[4], s[4], madd(left[2], s[2], left[0] * s[0]));
    const S odd = madd(left[5], s[5], madd(left[3], s[3], left[1] * s[1]));
    const S pivot = constant<S>(1) + (even + odd);
    S offset = constant<S>(0);
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) offset = madd(b.offset[i], s[i], offset);
    const S inverse = inverse_pivot(pivot);
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) {
      const S f = -(left[i] * inverse);
      b.offset[i] = madd(offset, f, b.offset[i]);
#pragma GCC unroll 6
      for (int j = 0; j < 6; ++j) b.response[i][j] = madd(right[j], f, b.response[i][j]);
    }
    S* row = b.own_rows + 8 * k;
    for (int j = 0; j < 6; ++j) row[j] = right[j];
    row[6] = offset;
    row[7] = inverse;
  }
}

/// Brings a contact into the matrix in these lanes.
template <class S>
STICKSLIP_INLINE void bring_alone(FactoredProblem<S>& p, FactoredContact<S>& c, Mask<S> lanes) {
  Row3<S> n[3];
  for (int r = 0; r < 3; ++r) n[r] = row_where(lanes, c.n_columns[r]);
  respond<0>(c, n);
  const S zero = constant<S>(0);
  S minus[3];
  for (int r = 0; r < 3; ++r) minus[r] = select(lanes, -c.n_offset[r], zero);
  add_transposed<0>(c, minus, p.scratch);
}

/// Brings a body into the matrix and the right-hand side -sum Y^T q.
template <class S>
STICKSLIP_STAGE void bring_body(FactoredProblem<S>& p, ContactBody<S>& b) {
  const Chunk<S>* columns = b.left_columns();
  const int chunks = b.chunks();
  for (int j = 0; j < chunks; ++j) {
    S* rhs = p.scratch + b.chunk_start()[j];
    Chunk<S> sum = load_chunk(rhs);
#pragma GCC unroll 6
    for (int r = 0; r < 6; ++r) {
      Chunk<S> x = columns[6 * j] * Chunk<S>(b.response[0][r]);
#pragma GCC unroll 6
      for (int i = 1; i < 6; ++i) x = madd_chunk<S>(columns[6 * j + i], b.response[i][r], x);
      b.response_rows[r * chunks + j] = x;
      sum = madd_chunk<S>(columns[6 * j + r], -b.offset[r], sum);
    }
    store_chunk(rhs, sum);
  }
}

/// The change of the body's twist that follows from the change x of the dofs left to the matrix and
/// those of its own, whose sizes are added to `size`.
template <class S>
STICKSLIP_STAGE void find_twist(ContactBody<S>& b, const S* x, S& size) {
  constexpr int K = kChunk<S>;
  S t[6];
  for (S& r : t) r = constant<S>(0);
  for (int k = 0, chunk = 0; k < b.left_count(); ++k) {
    const int dof = b.left()[k];
    chunk += dof >= b.chunk_start()[chunk] + K;
    const S* column =
        reinterpret_cast<const S*>(b.left_columns() + 6 * chunk) + (dof - b.chunk_start()[chunk]);
#pragma GCC unroll 6
    for (int r = 0; r < 6; ++r) t[r] = madd(column[r * K], x[dof], t[r]);
  }
  for (int k = 0; k < b.own_count(); ++k) {
    const S *row = b.own_rows + 8 * k, *s = b.own_column(k);
    S y = row[6];
#pragma GCC unroll 6
    for (int r = 0; r < 6; ++r) y = madd(row[r], t[r], y);
    y = -(y * row[7]);
    size = size + abs(y);
#pragma GCC unroll 6
    for (int r = 0; r < 6; ++r) t[r] = madd(s[r], y, t[r]);
  }
  for (int r = 0; r < 6; ++r) b.twist[r] = t[r];
}

/// The change of a contact's velocity: that of its body where this has several, else of its rows.
template <class S>
STICKSLIP_INLINE void change_on_body(const ContactBody<S>& b, const FactoredContact<S>& c,
                                     const S* x, S dv[3]) {
  const S* t = b.twist;
  const Vec3<S> v = cross(Vec3<S>{t[3], t[4], t[5]}, Vec3<S>{c.arm[0], c.arm[1], c.arm[2]},
                          Vec3<S>{t[0], t[1], t[2]});
  S alone[3] = {v.x, v.y, v.z};
  if (!all(b.several)) change_of<0>(c, x, alone);
  dv[0] = select(b.several, v.x, alone[0]);
  dv[1] = select(b.several, v.y, alone[1]);
  dv[2] = select(b.several, v.z, alone[2]);
}

/// One guarded Newton step on the lanes `live`.
template <class S>
STICKSLIP_STAGE void newton_step_by_bodies(FactoredProblem<S>& p, Mask<S> live, S alpha) {
  const S zero = constant<S>(0);
  for (int i = 0; i < p.num_bodies(); ++i) {
    ContactBody<S>& b = p.body(i);
    b.moves = false;
    for (auto& row : b.response)
      for (S& q : row) q = zero;
    for (S& q : b.offset) q = zero;
  }
  eliminate_contacts<0>(p, live, alpha, static_cast<const S*>(nullptr),
                        [&](FactoredContact<S>& c) STICKSLIP_LAMBDA {
                          if (c.body < 0) return bring_contact<0>(p, c);
                          ContactBody<S>& b = p.body(c.body);
                          b.moves = true;
                          add_response(b, c);
                          c.alone = c.single;
                          if (c.single) bring_alone(p, c, !b.several);
                        });
  for (int i = 0; i < p.num_bodies(); ++i) {
    ContactBody<S>& b = p.body(i);
    if (!b.moves) continue;
    pass_own_dofs(b);
    bring_body(p, b);
  }
  const S* x = solve_any(p, true);
  S size = zero;
  for (int k = 0; k < p.dofs(); ++k) size = size + abs(x[k]);
  for (int i = 0; i < p.num_bodies(); ++i)
    if (p.body(i).moves) find_twist(p.body(i), x, size);
  take_newton_step<0>(p, live & (size < constant<S>(kHugeStep)),
                      [&](const FactoredContact<S>& c, S dv[3]) STICKSLIP_LAMBDA {
                        if (c.body < 0)
                          change_of<0>(c, x, dv);
                        else
                          change_on_body(p.body(c.body), c, x, dv);
                      });
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
