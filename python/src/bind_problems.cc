// Generated contact problems. Ranges are checked in scenes/, types in python/stickslip/problems.py.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bindings.h"
#include "scenes/problem_families.h"
#include "words.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stickslip::python {
namespace {

constexpr Word<scenes::HeavyBoxes> kHeavyBoxes[] = {
    {"top", scenes::HeavyBoxes::kTop},
    {"bottom", scenes::HeavyBoxes::kBottom},
    {"alternating", scenes::HeavyBoxes::kAlternating},
};
constexpr Word<scenes::DuplicatedBase> kDuplicatedBases[] = {
    {"quadruped_standing", scenes::DuplicatedBase::kStanding},
    {"quadruped_trotting", scenes::DuplicatedBase::kTrotting},
    {"quadruped_impact", scenes::DuplicatedBase::kImpact},
    {"eight_contacts_resting", scenes::DuplicatedBase::kEightResting},
    {"eight_contacts_impact", scenes::DuplicatedBase::kEightImpact},
    {"box_stack", scenes::DuplicatedBase::kBoxStack},
};
constexpr Word<scenes::QuadrupedScene> kQuadrupedScenes[] = {
    {"quadruped_standing", scenes::kStand},        {"quadruped_trotting", scenes::kTrot},
    {"quadruped_impact", scenes::kImpact},         {"eight_contacts_resting", scenes::kRestEight},
    {"eight_contacts_impact", scenes::kDropEight},
};

template <class E, std::size_t N>
std::optional<E> choice(const char* argument, const std::optional<std::string>& text,
                        const Word<E> (&words)[N]) {
  if (!text) return std::nullopt;
  return choice(argument, *text, words);
}

/// (delassus (3n, 3n) or (k, 3, 3), free velocity (3n,), friction (n,), block starts (n + 1), block
/// columns (k)); the last two empty where it is dense.
nb::tuple arrays_of(const ContactProblem& p) {
  const std::size_t rows = p.free_velocity.size();
  const auto copy = [&](std::span<double> to) {
    std::copy(p.delassus.begin(), p.delassus.end(), to.begin());
  };
  const auto delassus = p.is_block_sparse() ? make_array({p.block_columns.size(), 3, 3}, copy)
                                            : make_array({rows, rows}, copy);
  return nb::make_tuple(delassus, copy_array(p.free_velocity), copy_array(p.friction),
                        p.block_starts, p.block_columns);
}

using Number = std::optional<double>;
using Count = std::optional<int>;

nb::tuple quadruped(const std::string& family, std::uint64_t seed, Number friction) {
  return arrays_of(scenes::quadruped(choice("family", family, kQuadrupedScenes), seed, {friction}));
}

nb::tuple box_stack(std::uint64_t seed, Count num_boxes, double mass_ratio,
                    const std::optional<std::string>& heavy, double size,
                    const std::optional<std::array<double, 2>>& push, Number noise,
                    Number friction) {
  return arrays_of(scenes::box_stack(
      seed,
      {num_boxes, mass_ratio, choice("heavy", heavy, kHeavyBoxes), size, push, noise, friction}));
}

nb::tuple duplicated_contacts(std::uint64_t seed, const std::optional<std::string>& base,
                              Count copies, Number friction) {
  return arrays_of(scenes::duplicated_contacts(
      seed, {choice("base", base, kDuplicatedBases), copies, friction}));
}

nb::tuple ill_conditioned(std::uint64_t seed, Count num_contacts, Number condition, Count rank,
                          Number friction) {
  return arrays_of(scenes::ill_conditioned(seed, {num_contacts, condition, rank, friction}));
}

nb::tuple sphere_pile(std::uint64_t seed, Count layers, double mass_ratio, double irregularity,
                      Number noise, Number friction) {
  return arrays_of(scenes::sphere_pile(seed, {layers, mass_ratio, irregularity, noise, friction}));
}

nb::tuple brick_wall(std::uint64_t seed, Count rows, Count columns, double mass_ratio, Number noise,
                     Number friction) {
  return arrays_of(scenes::brick_wall(seed, {rows, columns, mass_ratio, noise, friction}));
}

std::vector<std::string> family_names() {
  std::vector<std::string> names;
  for (const auto& family : scenes::problem_families()) names.push_back(family.name);
  return names;
}

}  // namespace

void bind_problems(nb::module_& parent) {
  nb::module_ m = parent.def_submodule("problems");
  m.def("family_names", &family_names);
  m.def(
      "random_problem",
      [](const std::string& family, std::uint64_t seed) {
        return arrays_of(scenes::random_problem(family, seed));
      },
      "family"_a, "seed"_a);
  m.def("quadruped", &quadruped, "family"_a, "seed"_a, "friction"_a.none());
  m.def("box_stack", &box_stack, "seed"_a, "num_boxes"_a.none(), "mass_ratio"_a, "heavy"_a.none(),
        "size"_a, "push"_a.none(), "noise"_a.none(), "friction"_a.none());
  m.def("duplicated_contacts", &duplicated_contacts, "seed"_a, "base"_a.none(), "copies"_a.none(),
        "friction"_a.none());
  m.def("ill_conditioned", &ill_conditioned, "seed"_a, "num_contacts"_a.none(),
        "condition"_a.none(), "rank"_a.none(), "friction"_a.none());
  m.def("sphere_pile", &sphere_pile, "seed"_a, "layers"_a.none(), "mass_ratio"_a, "irregularity"_a,
        "noise"_a.none(), "friction"_a.none());
  m.def("brick_wall", &brick_wall, "seed"_a, "rows"_a.none(), "columns"_a.none(), "mass_ratio"_a,
        "noise"_a.none(), "friction"_a.none());
}

}  // namespace stickslip::python
