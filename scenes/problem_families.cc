#include "scenes/problem_families.h"

#include "scenes/problem_options.h"

namespace stickslip::scenes {
namespace {

template <QuadrupedScene kScene>
ContactProblem make_quadruped(std::uint64_t seed) {
  return quadruped(kScene, seed);
}

constexpr ProblemFamily kFamilies[] = {
    {"quadruped_standing", &make_quadruped<kStand>},
    {"quadruped_trotting", &make_quadruped<kTrot>},
    {"quadruped_impact", &make_quadruped<kImpact>},
    {"eight_contacts_resting", &make_quadruped<kRestEight>},
    {"eight_contacts_impact", &make_quadruped<kDropEight>},
    {"box_stack", [](std::uint64_t seed) { return box_stack(seed); }},
    {"duplicated_contacts", [](std::uint64_t seed) { return duplicated_contacts(seed); }},
    {"ill_conditioned", [](std::uint64_t seed) { return ill_conditioned(seed); }},
    {"sphere_pile", [](std::uint64_t seed) { return sphere_pile(seed); }},
    {"brick_wall", [](std::uint64_t seed) { return brick_wall(seed); }},
};

}  // namespace

ContactProblem quadruped(QuadrupedScene scene, std::uint64_t seed,
                         const QuadrupedOptions& options) {
  check_friction(options.friction);
  Random rng(seed);
  RobotProblem p = random_robot_problem(scene, rng);
  p.mu = options.friction.value_or(p.mu);
  return dense(p);
}

std::span<const ProblemFamily> problem_families() { return kFamilies; }

ContactProblem random_problem(const std::string& family, std::uint64_t seed) {
  std::string names;
  for (const ProblemFamily& f : kFamilies) {
    if (family == f.name) return f.make(seed);
    names += std::string(names.empty() ? "'" : ", '") + f.name + "'";
  }
  refuse("family is '", family, "'; choose one of ", names);
}

}  // namespace stickslip::scenes
