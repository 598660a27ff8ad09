// An explicit problem (docs/theory/solvers.md, section 3) with its memory, from the public type.
#pragma once
#include <stickslip/contact.h>

#include <vector>

#include "contact/explicit_problem.h"

namespace stickslip::solvers {

/// Refers to `problem`, which must outlive it. Large dense problems of mostly zero blocks are kept
/// block sparse.
class ExplicitView {
 public:
  ExplicitView(const ContactProblem& problem, const std::vector<double>& impulse);
  ExplicitView(const ExplicitView&) = delete;
  ExplicitView& operator=(const ExplicitView&) = delete;

  contact::ExplicitProblem view;

 private:
  void drop_zero_blocks(const ContactProblem& problem);

  std::vector<double> memory_, blocks_;
  std::vector<int> starts_, columns_;
};

}  // namespace stickslip::solvers
