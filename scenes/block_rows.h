// A symmetric matrix of 3x3 blocks, most of them zero, while a contact problem is put together.
#pragma once
#include <stickslip/contact.h>

#include <array>
#include <map>
#include <utility>
#include <vector>

namespace stickslip::scenes {

class BlockRows {
 public:
  using Block = std::array<double, 9>;  // row-major

  explicit BlockRows(int contacts) : rows_(contacts) {}

  /// Block (i, j); zero when it is new.
  Block& at(int i, int j) { return rows_[i].try_emplace(j, Block{}).first->second; }

  /// The contact problem with this matrix [1/kg], (3n, 3n).
  ContactProblem dense_problem(std::vector<double> free_velocity,
                               std::vector<double> friction) const {
    ContactProblem p{{}, std::move(free_velocity), std::move(friction)};
    const std::size_t m = 3 * rows_.size();
    p.delassus.resize(m * m);
    for (std::size_t i = 0; i < rows_.size(); ++i)
      for (const auto& [j, block] : rows_[i])
        for (int k = 0; k < 9; ++k) p.delassus[(3 * i + k / 3) * m + 3 * j + k % 3] = block[k];
    return p;
  }
  /// The same, block sparse.
  ContactProblem sparse_problem(std::vector<double> free_velocity,
                                std::vector<double> friction) const {
    ContactProblem p{{}, std::move(free_velocity), std::move(friction)};
    p.block_starts.assign(1, 0);
    for (const auto& row : rows_) {
      for (const auto& [j, block] : row) {
        p.block_columns.push_back(j);
        p.delassus.insert(p.delassus.end(), block.begin(), block.end());
      }
      p.block_starts.push_back(static_cast<int>(p.block_columns.size()));
    }
    return p;
  }

 private:
  std::vector<std::map<int, Block>> rows_;  // by column
};

}  // namespace stickslip::scenes
