// A body that is in contact at several points: what the points have in common
// (docs/theory/solvers.md (C33a), (C33b)).
//
//   V = sum_k column_k w_k,   v_i = V_lin + V_ang x d_i (+ what does not come from w)
// Used terms: V twist of the body about a reference point [m/s, rad/s]; d_i from there to contact i
// [m]. Dofs that move no other contact are the body's own: a Newton step eliminates them inside the
// body, six numbers at a time, instead of in the matrix of all contacts.
#pragma once
#include "contact/arena.h"
#include "contact/chunk.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

template <class S>
class ContactBody {
 public:
  Mask<S> several;  // lanes in which it has two or more; in others they stand for themselves

  void lay_out(Arena& arena, int dofs) {
    own_columns_ = arena.take<S>(6 * dofs);
    left_ = arena.take<int>(dofs);
    start_ = arena.take<int>(dofs);
    left_columns_ = arena.take<Chunk<S>>(6 * dofs);
    own_rows = arena.take<S>(8 * dofs);
    response_rows = arena.take<Chunk<S>>(6 * dofs);
  }
  void clear() { own_ = left_count_ = chunks_ = 0; }

  /// Columns of a dof (lin, ang), zero in lanes where it is not the body's own, or is not left to
  /// the matrix. Dofs come in ascending order.
  void add_own(const S column[6]) {
    for (int r = 0; r < 6; ++r) own_columns_[6 * own_ + r] = column[r];
    ++own_;
  }
  void add_left(int dof, const S column[6]) {
    constexpr int K = kChunk<S>;
    left_[left_count_++] = dof;
    if (chunks_ == 0 || dof >= start_[chunks_ - 1] + K) {
      for (int r = 0; r < 6; ++r) left_columns_[6 * chunks_ + r] = Chunk<S>(constant<S>(0));
      start_[chunks_++] = dof;
    }
    const int chunk = chunks_ - 1, lane = dof - start_[chunk];
    for (int r = 0; r < 6; ++r)
      reinterpret_cast<S*>(left_columns_ + 6 * chunk + r)[lane] = column[r];
  }

  int own_count() const { return own_; }
  const S* own_column(int k) const { return own_columns_ + 6 * k; }
  int left_count() const { return left_count_; }
  const int* left() const { return left_; }
  int chunks() const { return chunks_; }
  const int* chunk_start() const { return start_; }
  /// (chunks, 6)
  const Chunk<S>* left_columns() const { return left_columns_; }

  // Newton step: to a change V of its twist the contacts answer with the wrench -(offset +
  // response V).
  bool moves;               // a contact of it takes part
  S response[6][6];         // Q [kg, kg m, kg m^2]
  S offset[6];              // q [N s, N m s]
  S* own_rows;              // (own_count, 8): column^T Q, column . q, inverse pivot; when passed
  Chunk<S>* response_rows;  // (6, chunks): Q^T columns of what is left
  S twist[6];               // V of the step

 private:
  int own_ = 0, left_count_ = 0, chunks_ = 0;
  S* own_columns_;
  int *left_, *start_;
  Chunk<S>* left_columns_;
};

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
