// Newton finish of a factored problem: one semismooth Newton step on the Alart-Curnier map with a
// proximal term, eliminated to the m shared dofs (docs/theory/solvers.md (C30)-(C34)).
//
// Per contact, in velocity units (scale = trace G_ii / 3), u its velocity, t = scale lambda_T -
// u_T, s = scale lambda_z - u_z:
//   F_z = u_z,  F_T = u_T (stick, |t| <= mu s)  or  scale lambda_T - mu s e, e = t / |t| (slip)
//   lambda = 0 where s <= 0
//   A dlambda + B du = -F,   du = (P + alpha scale I) dlambda + Y dw
//   =>  dlambda = -(g + N Y dw)
// With dw = sum Y^T dlambda this leaves (I + sum Y^T N Y) dw = -sum Y^T g: one m x m elimination
// instead of 3n x 3n.
#pragma once
#include "contact/shared_system.h"
#include "contact/sweep.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// What one contact brings into the step, and its elimination. T is S, or a pack of contacts of a
/// plain scalar.
template <class T>
struct NewtonBlock {
  T block[6];  // P, private part
  T mu, scale;
  T lambda[3];
  T u[3];  // contact velocity, with the proximal shift
  T n[9];  // out: N, row-major
  T g[3];  // out
};

/// A step above this, or not finite, is not taken.
inline constexpr double kHugeStep = 1e6;

/// Lanes where the contact is not both open and without an impulse; NaN counts.
template <class S>
STICKSLIP_INLINE Mask<S> may_move(S scale, const S l[3], S velocity) {
  const S zero = constant<S>(0), size = abs(l[0]) + abs(l[1]) + abs(l[2]);
  return !((madd(scale, l[2], -velocity) <= zero) & (size <= zero));
}

/// N and g of one contact. Where no lane in `live` slides, B is the identity and A is zero: the
/// same numbers with a fifth of the work.
template <class T>
STICKSLIP_INLINE void eliminate(NewtonBlock<T>& b, T alpha, Mask<T> live) {
  const T zero = constant<T>(0), one = constant<T>(1),
          tiny = constant<T>(sizeof(Value<T>) == 4 ? 1e-30 : 1e-200);
  const T s = madd(b.scale, b.lambda[2], -b.u[2]);
  const T t0 = madd(b.scale, b.lambda[0], -b.u[0]), t1 = madd(b.scale, b.lambda[1], -b.u[1]);
  const T norm = sqrt(madd(t0, t0, t1 * t1)), limit = b.mu * max(s, zero);
  const auto on = s > zero;
  const auto stick = norm <= limit;
  const T prox = alpha * b.scale, *p = b.block;
  const T dxx = p[0] + prox, dyy = p[3] + prox, dzz = p[5] + prox;
  // F, and C = A + B D.
  T f0 = b.u[0], f1 = b.u[1];
  const T f2 = b.u[2];
  T c00 = dxx, c01 = p[1], c02 = p[2], c10 = p[1], c11 = dyy, c12 = p[4];
  const T c20 = p[2], c21 = p[4], c22 = dzz;
  const bool slides = any(live & on & !stick);
  T b00, b01, b11, b02, b12;
  if (slides) {
    const T inv = one / max(norm, tiny), e0 = t0 * inv, e1 = t1 * inv,
            ratio = min(limit * inv, one);
    const T q00 = ratio * nmadd(e0, e0, one), q01 = -(ratio * (e0 * e1)),
            q11 = ratio * nmadd(e1, e1, one);
    const T m0 = b.mu * e0, m1 = b.mu * e1;
    // B = [b00 b01 b02; b01 b11 b12; 0 0 1], A only in the tangential rows.
    b00 = select(stick, one, q00), b01 = select(stick, zero, q01), b11 = select(stick, one, q11);
    b02 = select(stick, zero, m0), b12 = select(stick, zero, m1);
    f0 = select(stick, b.u[0], nmadd(limit, e0, b.scale * b.lambda[0]));
    f1 = select(stick, b.u[1], nmadd(limit, e1, b.scale * b.lambda[1]));
    const auto a = [&](T slip) { return select(stick, zero, slip); };
    c00 = madd(b00, dxx, madd(b01, p[1], madd(b02, p[2], a((one - q00) * b.scale))));
    c01 = madd(b00, p[1], madd(b01, dyy, madd(b02, p[4], a(-(q01 * b.scale)))));
    c02 = madd(b00, p[2], madd(b01, p[4], madd(b02, dzz, a(-(m0 * b.scale)))));
    c10 = madd(b01, dxx, madd(b11, p[1], madd(b12, p[2], a(-(q01 * b.scale)))));
    c11 = madd(b01, p[1], madd(b11, dyy, madd(b12, p[4], a((one - q11) * b.scale))));
    c12 = madd(b01, p[2], madd(b11, p[4], madd(b12, dzz, a(-(m1 * b.scale)))));
  }
  // Inverse by cofactors.
  const T j00 = nmadd(c12, c21, c11 * c22), j01 = nmadd(c01, c22, c02 * c21),
          j02 = nmadd(c02, c11, c01 * c12);
  const T j10 = nmadd(c10, c22, c12 * c20), j11 = nmadd(c02, c20, c00 * c22),
          j12 = nmadd(c00, c12, c02 * c10);
  const T j20 = nmadd(c11, c20, c10 * c21), j21 = nmadd(c00, c21, c01 * c20),
          j22 = nmadd(c01, c10, c00 * c11);
  const T det = madd(c00, j00, madd(c01, j10, c02 * j20));
  const T r = select(on, one / select(abs(det) > tiny, det, tiny), zero);
  const T rows[3][3] = {
      {j00 * r, j01 * r, j02 * r}, {j10 * r, j11 * r, j12 * r}, {j20 * r, j21 * r, j22 * r}};
  for (int i = 0; i < 3; ++i) {
    const T *j = rows[i], g = madd(j[0], f0, madd(j[1], f1, j[2] * f2));
    b.g[i] = select(on, g, b.lambda[i]);
    b.n[3 * i] = j[0];
    b.n[3 * i + 1] = j[1];
    b.n[3 * i + 2] = j[2];
    if (slides) {
      b.n[3 * i] = madd(j[0], b00, j[1] * b01);
      b.n[3 * i + 1] = madd(j[0], b01, j[1] * b11);
      b.n[3 * i + 2] = madd(j[0], b02, madd(j[1], b12, j[2]));
    }
  }
}

/// Columns of Y^T N of one contact over its shared dofs, by chunks; `columns` of N.
template <int M, class S>
STICKSLIP_INLINE void respond(FactoredContact<S>& c, const Row3<S> columns[3]) {
  const int chunks = chunk_count<M>(c);
  for (int r = 0; r < 3; ++r) {
    S n[3];
    store(columns[r], n);
    for (int j = 0; j < chunks; ++j) {
      Chunk<S> x = row_chunk<M>(c, 0, j) * Chunk<S>(n[0]);
      x = madd_chunk<S>(row_chunk<M>(c, 1, j), n[1], x);
      c.yn[r * chunks + j] = madd_chunk<S>(row_chunk<M>(c, 2, j), n[2], x);
    }
  }
}

/// Brings one contact into the matrix and the right-hand side -sum Y^T g, in p.scratch.
template <int M, class S>
STICKSLIP_INLINE void bring_contact(FactoredProblem<S>& p, FactoredContact<S>& c) {
  respond<M>(c, c.n_columns);
  const S minus[3] = {-c.n_offset[0], -c.n_offset[1], -c.n_offset[2]};
  add_transposed<M>(c, minus, p.scratch);
}

/// Elimination of all contacts that move, each then handed to bring(contact), into a right-hand
/// side that starts at zero. Four contacts at a time for a plain scalar: each contact's numbers are
/// the same either way. `center`: proximal center (n, 3), or null where it is the present impulse.
/// A contact that is open without an impulse in every live lane brings nothing, and is left out of
/// a pack's step.
template <int M, class S, class Bring>
STICKSLIP_STAGE void eliminate_contacts(FactoredProblem<S>& p, Mask<S> live, S alpha,
                                        const S* center, const Bring& bring) {
  constexpr bool kPlain = ScalarTraits<S>::kWidth == 1;
  constexpr int kLanes = kPlain ? 4 : 1;
  using T = Chunk<S>;
  const int n = p.size();
  S* rhs = p.scratch;
  for (int i = 0; i < p.stride(); ++i) rhs[i] = constant<S>(0);
  for (int first = 0; first < n; first += kLanes) {
    NewtonBlock<T> b;
    for (int l = 0; l < kLanes; ++l) {
      const int i = first + l < n ? first + l : first;  // the last pack is filled with copies
      FactoredContact<S>& c = p.contact(i);
      c.moves = c.alone = kPlain || any(live & c.active);
      if (!c.moves) continue;
      S v[3], lambda[3];
      contact_velocity<M>(c, p.w, v);
      store(c.lambda, lambda);
      if (center)
        for (int r = 0; r < 3; ++r)
          v[r] = madd(alpha * c.local.scale, lambda[r] - center[3 * i + r], v[r]);
      c.moves = c.alone = kPlain || any(live & may_move(c.local.scale, lambda, v[2]));
      S* out = reinterpret_cast<S*>(&b) + l;
      for (int r = 0; r < 6; ++r) out[r * kLanes] = c.private_block[r];
      out[6 * kLanes] = c.local.mu;
      out[7 * kLanes] = c.local.scale;
      for (int r = 0; r < 3; ++r) out[(8 + r) * kLanes] = lambda[r], out[(11 + r) * kLanes] = v[r];
    }
    if (!kPlain && !p.contact(first).moves) continue;
    if constexpr (kPlain)
      eliminate(b, T(alpha), T(alpha) >= T(alpha));
    else
      eliminate(b, alpha, live);
    for (int l = 0; l < kLanes && first + l < n; ++l) {
      FactoredContact<S>& c = p.contact(first + l);
      const S* out = reinterpret_cast<const S*>(&b) + l;
      const auto at = [out](int r) { return out[r * kLanes]; };
      for (int j = 0; j < 3; ++j) c.n_columns[j] = make_row3(at(14 + j), at(17 + j), at(20 + j));
      for (int r = 0; r < 3; ++r) c.n_offset[r] = at(23 + r);
      bring(c);
    }
  }
}

/// Takes a Newton step in the lanes `sane`: each contact's impulse answers to the change(contact,
/// out) of its velocity, returns to the cone (normal kept), and w follows. A lane whose step is not
/// finite or above 1e6 keeps its impulses: float lanes do meet a broken pivot.
template <int M, class S, class Change>
STICKSLIP_INLINE void take_newton_step(FactoredProblem<S>& p, Mask<S> sane, const Change& change) {
  const S zero = constant<S>(0), one = constant<S>(1), huge = constant<S>(kHugeStep);
  for (int i = 0; i < p.size(); ++i) {
    FactoredContact<S>& c = p.contact(i);
    if (!c.moves) {
      for (S& e : c.direction) e = select(sane, zero, e);
      continue;
    }
    S dv[3], response[3], old[3], l[3];
    change(c, dv);
    store(madd(c.n_columns[2], dv[2], madd(c.n_columns[1], dv[1], c.n_columns[0] * dv[0])),
          response);
    store(c.lambda, old);
    for (int r = 0; r < 3; ++r) l[r] = old[r] - (c.n_offset[r] + response[r]);
    l[2] = max(l[2], zero);
    const S square = madd(l[0], l[0], l[1] * l[1]), limit = c.local.mu * l[2];
    const auto some = square > constant<S>(sizeof(Value<S>) == 4 ? 1e-30 : 1e-100);
    const S inv = select(some, one / sqrt(select(some, square, one)), zero);
    const auto outside = square > limit * limit;
    const S ex = l[0] * inv, ey = l[1] * inv;
    l[0] = select(outside, ex * limit, l[0]);
    l[1] = select(outside, ey * limit, l[1]);
    const auto take = sane & ((abs(l[0]) + abs(l[1]) + l[2]) < huge);
    S d[3];
    for (int r = 0; r < 3; ++r) {
      l[r] = select(take, l[r], old[r]);
      d[r] = l[r] - old[r];
    }
    c.direction[0] = select(take, ex, c.direction[0]);
    c.direction[1] = select(take, ey, c.direction[1]);
    set_impulse(c, l);
    add_transposed<M>(c, d, p.w);
  }
}

/// What the rows of a contact make of a change x of w.
template <int M, class S>
STICKSLIP_INLINE void change_of(const FactoredContact<S>& c, const S* x, S dv[3]) {
  const S zero = constant<S>(0);
  store(add_rows<M>(c, x, make_row3(zero, zero, zero)), dv);
}

/// One guarded Newton step on the lanes `live`.
template <int M, class S>
STICKSLIP_STAGE void newton_step(FactoredProblem<S>& p, Mask<S> live, S alpha) {
  eliminate_contacts<M>(p, live, alpha, static_cast<const S*>(nullptr),
                        [&](FactoredContact<S>& c) STICKSLIP_LAMBDA { bring_contact<M>(p, c); });
  const S* x = solve_shared<M>(p);
  S size = constant<S>(0);
  for (int k = 0; k < (M ? M : p.dofs()); ++k) size = size + abs(x[k]);
  take_newton_step<M>(p, live & (size < constant<S>(kHugeStep)),
                      [&](const FactoredContact<S>& c, S dv[3])
                          STICKSLIP_LAMBDA { change_of<M>(c, x, dv); });
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
