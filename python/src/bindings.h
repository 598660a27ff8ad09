// What the binding files share: one function per subject, and arrays in and out.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <span>

namespace stickslip::python {

void bind_model(nanobind::module_& m);
void bind_contact(nanobind::module_& m);
void bind_world(nanobind::module_& m);
void bind_batch(nanobind::module_& m);
void bind_scenes(nanobind::module_& m);
void bind_problems(nanobind::module_& m);

/// Arrays that come in: contiguous float64. The Python front makes them so; shapes are checked by
/// name there.
using VectorIn =
    nanobind::ndarray<const double, nanobind::ndim<1>, nanobind::c_contig, nanobind::device::cpu>;
/// Arrays that go out: NumPy, owned by Python, never a view of the simulation (which would change
/// under the reader).
/// Properties that return one say rv_policy::move: their default would tie the array to its object
/// as well, which nanobind refuses for arrays that own their data.
using ArrayOut = nanobind::ndarray<nanobind::numpy, double, nanobind::c_contig>;

inline std::span<const double> span_of(const VectorIn& array) {
  return {array.data(), array.size()};
}

/// A new array of this shape, filled by `fill(std::span<double>)`. Freed also when `fill` throws.
template <class Fill>
ArrayOut make_array(std::initializer_list<std::size_t> shape, Fill&& fill) {
  std::size_t size = 1;
  for (const std::size_t extent : shape) size *= extent;
  double* data = new double[size > 0 ? size : 1];
  nanobind::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  fill(std::span<double>(data, size));
  return ArrayOut(data, shape, owner);
}

/// A copy of a vector.
inline ArrayOut copy_array(std::span<const double> from) {
  return make_array({from.size()},
                    [&](std::span<double> to) { std::copy(from.begin(), from.end(), to.begin()); });
}

}  // namespace stickslip::python
