// Contacts that couple only through a few shared dofs, and the memory of their solve
// (docs/theory/solvers.md (C20)-(C24)).
//
//   v_i = c0_i + Y_i w + P_i lambda_i,   w = w0 + sum_j Y_j^T lambda_j,   G_ii = Y_i Y_i^T + P_i
// Used terms: w shared vector (m); Y_i rows of contact i on the shared dofs it touches; P_i its
// private part (dofs of a branch that no other contact touches) [1/kg]; c0_i offset velocity [m/s].
// No off-diagonal Delassus block is ever formed.
//
// Layout: a plain scalar keeps rows twice, as columns of three (velocity: 3 rows at once) and
// transposed in chunks of four dofs (update of w: a chunk at once). For a pack a chunk is one dof,
// and the columns serve both. Either way each number goes through the same operations in the same
// order, so a lane of a pack has the bits of the plain scalar.
//
// In a pack the problem is the union of what its lanes need. A lane has `active` false for a
// contact that is not its own, and columns of zeros for dofs that only other lanes share. Neither
// changes a bit of it (but the sign of a zero) against the problem of that lane alone, as long as
// its own contacts and dofs come in the same order and its dofs lie in the same chains (`clear`).
#pragma once
#include "contact/bodies.h"
#include "contact/coupling.h"
#include "contact/residual.h"

// A stage of the solve: one copy of machine code. Inlining a stage into every caller costs minutes
// of compilation and gains nothing, a call being a nanosecond.
#define STICKSLIP_STAGE inline __attribute__((noinline))

namespace stickslip::contact::inline STICKSLIP_KERNELS {

constexpr int round_up(int n, int k) { return (n + k - 1) / k * k; }

/// A symmetric 3x3 matrix whose columns are needed: for a plain scalar one register each, for a
/// pack its six numbers.
template <class S, bool kPlain = ScalarTraits<S>::kWidth == 1>
struct Symmetric3 {
  S xx, xy, xz, yy, yz, zz;
  STICKSLIP_INLINE Row3<S> column(int r) const {
    return r == 0 ? Row3<S>{xx, xy, xz} : r == 1 ? Row3<S>{xy, yy, yz} : Row3<S>{xz, yz, zz};
  }
  /// += row row^T
  STICKSLIP_INLINE void add_square(const Row3<S>& row) {
    const S &x = row.x, &y = row.y, &z = row.z;
    xx = madd(x, x, xx), xy = madd(x, y, xy), xz = madd(x, z, xz);
    yy = madd(y, y, yy), yz = madd(y, z, yz), zz = madd(z, z, zz);
  }
  /// xx xy xz yy yz zz
  STICKSLIP_INLINE void store_to(S block[6]) const {
    block[0] = xx, block[1] = xy, block[2] = xz, block[3] = yy, block[4] = yz, block[5] = zz;
  }
};
template <class S>
struct Symmetric3<S, true> {
  Row3<S> columns[3];
  STICKSLIP_INLINE const Row3<S>& column(int r) const { return columns[r]; }
  STICKSLIP_INLINE void add_square(const Row3<S>& row) {
    S numbers[3];
    store(row, numbers);
    for (int r = 0; r < 3; ++r) columns[r] = madd(row, numbers[r], columns[r]);
  }
  STICKSLIP_INLINE void store_to(S block[6]) const {
    S rows[3][3];
    for (int r = 0; r < 3; ++r) store(columns[r], rows[r]);
    for (int r = 0, k = 0; r < 3; ++r)
      for (int c = r; c < 3; ++c, ++k) block[k] = rows[r][c];
  }
};
template <class S>
STICKSLIP_INLINE Symmetric3<S> make_symmetric(S xx, S xy, S xz, S yy, S yz, S zz) {
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return {{make_row3(xx, xy, xz), make_row3(xy, yy, yz), make_row3(xz, yz, zz)}};
  else
    return {xx, xy, xz, yy, yz, zz};
}

template <class S>
STICKSLIP_INLINE Symmetric3<S> zero_symmetric() {
  const S o = constant<S>(0);
  return make_symmetric(o, o, o, o, o, o);
}

/// One contact of a factored problem. The owner fills the inputs; `prepare_contact` the rest.
template <class S>
struct FactoredContact {
  // Inputs.
  S friction;            // mu [1]
  S private_block[6];    // P: xx, xy, xz, yy, yz, zz [1/kg]
  S offset[3];           // c0 [m/s]
  S impulse[3];          // in: warm start, out: solution [N s]
  Mask<S> active;        // false in lanes that do not have this contact
  int count;             // shared dofs it touches
  int* index;            // which ones, ascending
  int body;              // that it shares with others; -1: none
  bool single;           // in some lane no other contact is on its body
  S arm[3];              // from that body's reference point [m]
  const bool* odd;       // of the problem's dofs: which of two chains sums it (add_rows)
  bool alternates;       // index[k] is in chain k & 1
  bool begins_with_six;  // alternates, first dofs 0 to 5 (a floating base)
  Row3<S>* y;            // column k: the three rows at dof index[k] [1/sqrt(kg)]
  // Output.
  S velocity[3];  // v_i [m/s]
  // Derived.
  LocalContact<S> local;
  Row3<S> base;  // c0 - (Y Y^T) lambda: velocity without own impulse is base + Y w
  Row3<S> lambda;
  Symmetric3<S> inverse;  // G_ii^-1 (from S^-1): the stick impulse is -G_ii^-1 c
  Symmetric3<S> shared;   // Y Y^T
  S direction[2];         // unit direction of the last slip impulse, or zero
  // Transposed rows of a plain scalar.
  int chunks;
  int* chunk_start;  // dof of a chunk's first lane
  Chunk<S>* yt;      // (chunks, 3), zero where a chunk reaches past the touched dofs
  // Newton step.
  bool moves;            // it takes part
  bool alone;            // with rows of its own in the matrix, in some lane
  Row3<S> n_columns[3];  // N, eliminated response of the contact
  S n_offset[3];
  Chunk<S>* yn;  // (3, chunks): columns of Y^T N
};

/// Chunks of the dofs that a contact touches; M = 6: all six dofs, else by index.
template <int M, class S>
STICKSLIP_INLINE int chunk_count(const FactoredContact<S>& c) {
  if constexpr (M > 0)
    return round_up(M, kChunk<S>) / kChunk<S>;
  else
    return ScalarTraits<S>::kWidth == 1 ? c.chunks : c.count;
}
/// The first dof of a chunk.
template <int M, class S>
STICKSLIP_INLINE int first_dof(const FactoredContact<S>& c, int chunk) {
  if constexpr (M > 0)
    return chunk * kChunk<S>;
  else
    return ScalarTraits<S>::kWidth == 1 ? c.chunk_start[chunk] : c.index[chunk];
}
/// Row r at the dofs of a chunk.
template <int M, class S>
STICKSLIP_INLINE const Chunk<S>& row_chunk(const FactoredContact<S>& c, int r, int chunk) {
  if constexpr (ScalarTraits<S>::kWidth == 1)
    return c.yt[3 * chunk + r];
  else
    return r == 0 ? c.y[chunk].x : r == 1 ? c.y[chunk].y : c.y[chunk].z;
}

/// Sizes of a workspace: how many contacts and shared dofs it can hold.
struct FactoredCapacity {
  int contacts = 0;
  int dofs = 0;
  int bodies = 0;  // with several contacts
};

/// A factored problem and everything its solve needs. Memory is attached once; nothing allocates
/// afterwards.
template <class S>
class FactoredProblem {
 public:
  /// Bytes that `attach` needs. The block must be aligned to 64.
  static long required_bytes(FactoredCapacity capacity) {
    FactoredProblem p;
    return p.lay_out(nullptr, capacity);
  }
  void attach(void* memory, FactoredCapacity capacity) { lay_out(memory, capacity); }

  /// Starts a new problem with m shared dofs and w0 = 0. `odd[k]`: in which of two chains the
  /// products of dof k are added (default: k & 1). Where lanes share different dofs it must be a
  /// property of the dof, not of its number here. Fast is what alternates along the dofs of a
  /// contact: k & 1 for those of a base, then the parity of the depth of a joint.
  void clear(int m, const bool* odd = nullptr) {
    n_ = 0;
    m_ = m;
    num_bodies_ = 0;
    identity_ = true;
    coupled_ = Coupled::kNot;
    for (int k = 0; k < padded(m); ++k) w0[k] = constant<S>(0);
    odd_ = odd ? given_ : alternating_;
    for (int k = 0; odd && k < m; ++k) {
      given_[k] = odd[k];
      identity_ = identity_ && odd[k] == (k & 1);
    }
  }
  /// Adds a contact that touches all shared dofs; its number. The caller sets what else it is.
  int append() {
    contacts_[n_].count = -1;
    contacts_[n_].body = -1;
    contacts_[n_].single = true;
    coupled_ = Coupled::kNot;
    return n_++;
  }
  /// The same, without private part, offset or warm start.
  int add() {
    FactoredContact<S>& c = contacts_[append()];
    const S zero = constant<S>(0);
    c.friction = zero;
    for (S& x : c.private_block) x = zero;
    for (int r = 0; r < 3; ++r) c.offset[r] = c.impulse[r] = zero;
    c.active = !none<S>();
    return n_ - 1;
  }
  /// The contact touches only these shared dofs (ascending); its rows are then y(i)[k] at dof
  /// index[k].
  void set_index(int i, const int* index, int count) {
    coupled_ = Coupled::kNot;
    contacts_[i].count = count;
    for (int k = 0; k < count; ++k) contacts_[i].index[k] = index[k];
    identity_ = false;
  }

  /// Fills in the index list of a contact that touches all shared dofs, and its chains.
  void complete(int i) {
    if (six()) return;
    FactoredContact<S>& c = contacts_[i];
    if (c.count < 0) {
      c.count = m_;
      for (int k = 0; k < m_; ++k) c.index[k] = k;
    }
    c.odd = odd_;
    c.alternates = true;
    for (int k = 0; k < c.count; ++k) c.alternates = c.alternates && odd_[c.index[k]] == (k & 1);
    c.begins_with_six = c.alternates && c.count >= 6;
    for (int k = 0; k < 6 && c.begins_with_six; ++k) c.begins_with_six = c.index[k] == k;
  }

  /// The contacts [first, end), whose `active` is set, are on one body and touch the same dofs,
  /// several of them in these lanes. The caller sets their `arm`, and the columns of the body.
  ContactBody<S>& add_body(int first, int end, Mask<S> several) {
    for (int i = first; i < end; ++i) {
      contacts_[i].body = num_bodies_;
      contacts_[i].single = any(contacts_[i].active & !several);
    }
    ContactBody<S>& b = bodies_[num_bodies_++];
    b.clear();
    b.several = several;
    coupled_ = Coupled::kNot;
    return b;
  }
  int num_bodies() const { return num_bodies_; }
  ContactBody<S>& body(int i) { return bodies_[i]; }

  /// Makes `coupling` that of the contacts, which are complete.
  void couple_contacts() {
    if (coupled_ == Coupled::kContacts) return;
    coupling.begin(m_);
    for (int i = 0; i < n_; ++i) coupling.add(contacts_[i].index, contacts_[i].count);
    coupling.complete();
    coupled_ = Coupled::kContacts;
  }
  /// The same with bodies in place of their contacts.
  void couple_bodies() {
    if (coupled_ == Coupled::kBodies) return;
    coupling.begin(m_);
    for (int i = 0; i < n_; ++i)
      if (contacts_[i].single) coupling.add(contacts_[i].index, contacts_[i].count);
    for (int i = 0; i < num_bodies_; ++i) coupling.add(bodies_[i].left(), bodies_[i].left_count());
    coupling.complete();
    coupled_ = Coupled::kBodies;
  }

  Row3<S>* y(int i) { return contacts_[i].y; }
  S* private_block(int i) { return contacts_[i].private_block; }
  S* offset(int i) { return contacts_[i].offset; }
  S& friction(int i) { return contacts_[i].friction; }
  S* impulse(int i) { return contacts_[i].impulse; }
  Mask<S>& active(int i) { return contacts_[i].active; }
  const S* velocity(int i) const { return contacts_[i].velocity; }
  FactoredContact<S>& contact(int i) { return contacts_[i]; }
  const FactoredContact<S>& contact(int i) const { return contacts_[i]; }

  int size() const { return n_; }
  int dofs() const { return m_; }
  const bool* odd() const { return odd_; }
  /// Every contact touches all of exactly six dofs (one floating base): the unrolled case.
  bool six() const { return identity_ && m_ == 6; }
  FactoredCapacity capacity() const { return capacity_; }
  static constexpr int padded(int m) { return round_up(m + 1, 4) + 4; }
  int stride() const { return padded(m_); }

  S* w0 = nullptr;       // (m) in
  S* w = nullptr;        // (m) out
  S* matrix = nullptr;   // (m, stride): I + sum Y^T N Y
  Coupling coupling;     // of its dofs
  S* scratch = nullptr;  // (3, stride)
  S* saved = nullptr;    // (5, n, 3) impulses kept by the fallback
  FactoredProblem<double>* lane =
      nullptr;  // where the fallback solves one lane of a pack, or a float problem

 private:
  long lay_out(void* memory, FactoredCapacity capacity) {
    Arena arena(memory);
    capacity_ = capacity;
    const int n = capacity.contacts, m = capacity.dofs, wide = padded(m);
    contacts_ = arena.take<FactoredContact<S>>(n);
    w0 = arena.take<S>(wide);
    w = arena.take<S>(wide);
    matrix = arena.take<S>(long(m) * wide + 8);
    scratch = arena.take<S>(3 * wide);
    saved = arena.take<S>(15 * n);
    given_ = arena.take<bool>(m);
    alternating_ = arena.take<bool>(m);
    for (int k = 0; memory && k < m; ++k) alternating_[k] = k & 1;
    coupling.lay_out(arena, n + capacity.bodies, m);
    bodies_ = arena.take<ContactBody<S>>(capacity.bodies);
    for (int i = 0; i < capacity.bodies; ++i) {
      ContactBody<S> unused;
      (memory ? bodies_[i] : unused).lay_out(arena, m);
    }
    for (int i = 0; i < n; ++i) {
      int* index = arena.take<int>(m);
      Row3<S>* y = arena.take<Row3<S>>(m);
      Chunk<S>* yn = arena.take<Chunk<S>>(3 * m);
      int* start = kPlain ? arena.take<int>(m) : nullptr;
      Chunk<S>* yt = kPlain ? arena.take<Chunk<S>>(3 * m) : nullptr;
      if (memory) {
        contacts_[i].index = index;
        contacts_[i].y = y;
        contacts_[i].yn = yn;
        contacts_[i].chunk_start = start;
        contacts_[i].yt = yt;
      }
    }
    if constexpr (!kIsDouble) {
      lane = arena.template take<FactoredProblem<double>>(1);
      const FactoredCapacity without_bodies{n, m};
      const long inner = FactoredProblem<double>::required_bytes(without_bodies);
      char* block = arena.template take<char>(inner + 64);
      if (memory) lane->attach(block, without_bodies);
    }
    return arena.used();
  }
  static constexpr bool kPlain = ScalarTraits<S>::kWidth == 1;
  static constexpr bool kIsDouble = kPlain && sizeof(S) == 8;

  enum class Coupled { kNot, kContacts, kBodies };

  FactoredContact<S>* contacts_ = nullptr;
  ContactBody<S>* bodies_ = nullptr;
  FactoredCapacity capacity_;
  int n_ = 0, m_ = 0, num_bodies_ = 0;
  bool *given_ = nullptr, *alternating_ = nullptr;
  const bool* odd_ = nullptr;  // one of the two
  bool identity_ = true;
  Coupled coupled_ = Coupled::kNot;
};

/// The first six terms of `add_rows`, where they are dofs 0 to 5.
template <class S>
STICKSLIP_INLINE void add_six_rows(const FactoredContact<S>& c, const S* w, Row3<S>& a,
                                   Row3<S>& b) {
  a = madd(c.y[0], w[0], a), b = madd(c.y[1], w[1], b);
  a = madd(c.y[2], w[2], a), b = madd(c.y[3], w[3], b);
  a = madd(c.y[4], w[4], a), b = madd(c.y[5], w[5], b);
}

/// Y w of a contact on top of `start`: even and odd dofs in two chains, which halves the latency. M
/// = 6: all six dofs, unrolled; M = 0: by index.
template <int M, class S>
STICKSLIP_INLINE Row3<S> add_rows(const FactoredContact<S>& c, const S* w, const Row3<S>& start) {
  const S zero = constant<S>(0);
  Row3<S> a = start, b = make_row3(zero, zero, zero);
  if constexpr (M == 6) {
    add_six_rows(c, w, a, b);
  } else if (c.alternates) {
    int k = 0;
    if (c.begins_with_six) add_six_rows(c, w, a, b), k = 6;
    for (; k + 1 < c.count; k += 2) {
      a = madd(c.y[k], w[c.index[k]], a);
      b = madd(c.y[k + 1], w[c.index[k + 1]], b);
    }
    if (c.count & 1) a = madd(c.y[c.count - 1], w[c.index[c.count - 1]], a);
  } else {
    for (int k = 0; k < c.count; ++k) {
      if (c.odd[c.index[k]])
        b = madd(c.y[k], w[c.index[k]], b);
      else
        a = madd(c.y[k], w[c.index[k]], a);
    }
  }
  return a + b;
}

/// target += Y^T d, in one chunk: t is its place in target.
template <int M, class S>
STICKSLIP_INLINE void add_transposed_chunk(const FactoredContact<S>& c, const S d[3], int chunk,
                                           S* t) {
  Chunk<S> v = load_chunk(t);
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r) v = madd_chunk<S>(row_chunk<M>(c, r, chunk), d[r], v);
  store_chunk(t, v);
}

/// target += Y^T d.
template <int M, class S>
STICKSLIP_INLINE void add_transposed(const FactoredContact<S>& c, const S d[3], S* target) {
  const int chunks = chunk_count<M>(c);
  int j = 0;
  if constexpr (M == 0 && kChunk<S> == 1)
    if (c.begins_with_six)
#pragma GCC unroll 6
      for (; j < 6; ++j) add_transposed_chunk<M>(c, d, j, target + j);
#pragma GCC unroll 6
  for (; j < chunks; ++j) add_transposed_chunk<M>(c, d, j, target + first_dof<M>(c, j));
}

/// v_i = c0 + Y w + P lambda.
template <int M, class S>
STICKSLIP_INLINE void contact_velocity(const FactoredContact<S>& c, const S* w, S v[3]) {
  S l[3];
  store(c.lambda, l);
  const S* p = c.private_block;
  Row3<S> x = make_row3(c.offset[0], c.offset[1], c.offset[2]);
  x = madd(make_row3(p[0], p[1], p[2]), l[0], x);
  x = madd(make_row3(p[1], p[3], p[4]), l[1], x);
  x = madd(make_row3(p[2], p[4], p[5]), l[2], x);
  store(add_rows<M>(c, w, x), v);
}

/// base = c0 - (Y Y^T) lambda, after an impulse changed.
template <class S>
STICKSLIP_INLINE void update_base(FactoredContact<S>& c, const S l[3]) {
  Row3<S> x = make_row3(c.offset[0], c.offset[1], c.offset[2]);
  for (int r = 0; r < 3; ++r) x = nmadd(c.shared.column(r), l[r], x);
  c.base = x;
}

/// Unit direction of the tangential impulse, zero if there is none: where the next slip solve
/// starts.
template <class S>
STICKSLIP_INLINE void reset_direction(FactoredContact<S>& c, const S l[3]) {
  const S zero = constant<S>(0), one = constant<S>(1), square = madd(l[0], l[0], l[1] * l[1]);
  const auto some = square > constant<S>(sizeof(Value<S>) == 4 ? 1e-30 : 1e-100);
  const S inv = select(some, one / sqrt(select(some, square, one)), zero);
  c.direction[0] = l[0] * inv;
  c.direction[1] = l[1] * inv;
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
