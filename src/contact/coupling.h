// Which shared dofs couple in the matrix of a Newton step, and in what order they leave it.
//
// Two dofs couple if a contact (or a body that stands for its contacts) touches both. Dofs are
// eliminated from the last to the first, which in a tree (parents come first) couples no others: of
// a chain's dofs each couples with its ancestors, and two legs only through the base. Index lists
// that are no tree fill in; what they fill is in the lists too [George, Liu 1981, ch. 5].
#pragma once
#include "contact/arena.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

class Coupling {
 public:
  void lay_out(Arena& arena, int contacts, int dofs) {
    const int words = (dofs + kBits - 1) / kBits;
    rows_ = arena.take<Word>(long(dofs) * words);
    touched_ = arena.take<Word>(words);
    before_ = arena.take<Word>(words);
    lists_ = arena.take<int>(long(dofs) * dofs);
    count_ = arena.take<int>(dofs);
    added_ = arena.take<int>(1 + long(contacts) * (1 + dofs));
    length_ = 0;
  }

  /// Contacts follow, which touch some of m dofs.
  void begin(int m) {
    m_ = m;
    end_ = last_ = 0;
    same_ = true;
    note(m);
  }
  /// A contact touches these dofs (ascending).
  void add(const int* index, int count) {
    if (last_ && added_[last_] == count) {  // as the contact before: often, on a sole
      int k = 0;
      while (k < count && added_[last_ + 1 + k] == index[k]) ++k;
      if (k == count) return;
    }
    last_ = end_;
    note(count);
    for (int k = 0; k < count; ++k) note(index[k]);
  }
  /// All contacts are there: makes the lists, if they are not those of the last time.
  void complete() {
    if (same_ && end_ == length_) return;
    length_ = end_;
    words_ = (m_ + kBits - 1) / kBits;
    for (int k = 0; k < m_ * words_; ++k) rows_[k] = 0;
    for (int w = 0; w < words_; ++w) touched_[w] = 0;
    for (int at = 1; at < length_; at += 1 + added_[at]) couple(added_ + at + 1, added_[at]);
    eliminate();
  }

  /// Whether any of them touches j; else it is not part of the matrix.
  bool touched(int j) const { return touched_[j / kBits] >> j % kBits & 1; }
  /// The dofs before j that it couples with when its turn comes, ascending.
  const int* list(int j) const { return lists_ + j * m_; }
  int count(int j) const { return count_[j]; }
  /// Whether j and the two before it couple with each other and otherwise with the same dofs.
  bool three(int j) const { return follows(j) && follows(j - 1); }

 private:
  using Word = unsigned long long;
  static constexpr int kBits = 64;

  void note(int number) {
    same_ = same_ && end_ < length_ && added_[end_] == number;
    added_[end_++] = number;
  }
  bool follows(int j) const {
    return j > 0 && count_[j] == count_[j - 1] + 1 && list(j)[count_[j] - 1] == j - 1;
  }
  void couple(const int* index, int count) {
    for (int w = 0; w < words_; ++w) before_[w] = 0;
    for (int k = 0; k < count; ++k) {
      Word* row = rows_ + index[k] * words_;
      for (int w = 0; w < words_; ++w) row[w] |= before_[w];
      before_[index[k] / kBits] |= Word(1) << index[k] % kBits;
    }
    for (int w = 0; w < words_; ++w) touched_[w] |= before_[w];
  }
  /// Fills in what elimination couples, and writes the lists.
  void eliminate() {
    for (int j = m_ - 1; j >= 0; --j) {
      const Word* row = rows_ + j * words_;
      int* list = lists_ + j * m_;
      int n = 0;
      for (int w = 0; w < words_; ++w)
        for (Word left = row[w]; left; left &= left - 1)
          list[n++] = w * kBits + __builtin_ctzll(left);
      count_[j] = n;
      if (n < 2) continue;
      const int next = list[n - 1];
      Word* to = rows_ + next * words_;
      for (int w = 0; w < words_; ++w) to[w] |= row[w];
      to[next / kBits] &= ~(Word(1) << next % kBits);
    }
  }

  int m_ = 0, words_ = 0;
  int* added_ = nullptr;  // m, then of each contact unlike the one before: count, dofs
  int length_ = 0;        // of what the lists were made from
  int end_ = 0, last_ = 0;
  bool same_ = false;                            // so far
  Word* rows_ = nullptr;                         // (dofs, words): sets of dofs
  Word *touched_ = nullptr, *before_ = nullptr;  // by any contact, by one so far
  int *lists_ = nullptr, *count_ = nullptr;
};

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
