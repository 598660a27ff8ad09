// A factored problem that owns its memory, for the tests of its solver.
#pragma once
#include <cstdlib>
#include <cstring>
#include <memory>

#include "contact/factored_problem.h"

namespace stickslip::contact {

/// A factored problem with its memory.
template <class S>
struct Owned {
  explicit Owned(FactoredCapacity capacity = {12, 12}) {
    const long bytes = (FactoredProblem<S>::required_bytes(capacity) + 63) / 64 * 64;
    memory.reset(static_cast<char*>(std::aligned_alloc(64, bytes)));
    std::memset(memory.get(), 0xff, bytes);  // NaN: what is read before it is written shows
    p.attach(memory.get(), capacity);
  }
  struct Free {
    void operator()(char* m) const { std::free(m); }
  };
  std::unique_ptr<char, Free> memory;
  FactoredProblem<S> p;
};

}  // namespace stickslip::contact
