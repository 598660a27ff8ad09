#include "solvers/islands.h"

#include <algorithm>

namespace stickslip::solvers {
Islands::Islands(const contact::ExplicitProblem& p) : island_(p.n, -1) {
  std::vector<int> reached;
  for (int first = 0; first < p.n; ++first) {
    if (island_[first] >= 0) continue;
    island_[first] = count_;
    reached.assign(1, first);
    while (!reached.empty()) {
      const int i = reached.back();
      reached.pop_back();
      contact::for_each_block(p, i, [&](int j, const double* g, int stride) {
        if (island_[j] >= 0 || contact::is_zero_block(g, stride)) return;
        island_[j] = count_;
        reached.push_back(j);
      });
    }
    ++count_;
  }
}

std::vector<int> Islands::contacts(int island) const {
  std::vector<int> out;
  for (std::size_t i = 0; i < island_.size(); ++i)
    if (island_[i] == island) out.push_back(int(i));
  return out;
}

Island::Island(const contact::ExplicitProblem& p, const std::vector<int>& contacts) {
  std::vector<double> impulse;
  problem_.block_starts.assign(1, 0);
  for (const int i : contacts) {
    contact::for_each_block(p, i, [&](int j, const double* g, int stride) {
      const auto at = std::lower_bound(contacts.begin(), contacts.end(), j);
      if (at == contacts.end() || *at != j) return;
      problem_.block_columns.push_back(int(at - contacts.begin()));
      for (int r = 0; r < 3; ++r)
        problem_.delassus.insert(problem_.delassus.end(), g + long(r) * stride,
                                 g + long(r) * stride + 3);
    });
    problem_.block_starts.push_back(int(problem_.block_columns.size()));
    problem_.free_velocity.insert(problem_.free_velocity.end(), p.c + 3 * i, p.c + 3 * i + 3);
    problem_.friction.push_back(p.mu[i]);
    impulse.insert(impulse.end(), p.lambda + 3 * i, p.lambda + 3 * i + 3);
  }
  view_ = std::make_unique<ExplicitView>(problem_, impulse);
}

}  // namespace stickslip::solvers
