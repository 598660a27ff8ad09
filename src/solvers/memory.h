// Where the methods take their memory from: the heap, or a block that a step has set aside.
#pragma once
#include <memory_resource>
#include <vector>

namespace stickslip::solvers {

using Memory = std::pmr::memory_resource*;
using Doubles = std::pmr::vector<double>;
using Integers = std::pmr::vector<int>;

}  // namespace stickslip::solvers
