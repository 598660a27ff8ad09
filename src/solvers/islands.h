// Islands (docs/theory/solvers.md, section 7): groups of contacts that couple with each other,
// directly or through others, and with no one else.
#pragma once
#include <stickslip/contact.h>

#include <memory>
#include <vector>

#include "solvers/explicit_view.h"

namespace stickslip::solvers {

/// The connected components of the blocks of G.
class Islands {
 public:
  explicit Islands(const contact::ExplicitProblem& p);
  int count() const { return count_; }
  /// Ascending.
  std::vector<int> contacts(int island) const;

 private:
  std::vector<int> island_;  // of each contact
  int count_ = 0;
};

/// Some contacts of a problem as one of their own, with their present impulses as its start.
class Island {
 public:
  Island(const contact::ExplicitProblem& p, const std::vector<int>& contacts);
  contact::ExplicitProblem& view() const { return view_->view; }

 private:
  ContactProblem problem_;
  std::unique_ptr<ExplicitView> view_;
};

}  // namespace stickslip::solvers
