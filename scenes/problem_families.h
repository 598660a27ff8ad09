// Families of contact problems. A problem is a pure function of a seed and options, the same on
// every machine; an option that is not set is drawn from the seed. All are J M^-1 J^T and J u_free
// of bodies after kProblemStep of free motion: the free velocity lies in the range of the matrix.
//
// Options out of range throw ModelError that names the option and its range.
#pragma once
#include <stickslip/contact.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scenes/quadruped.h"

namespace stickslip::scenes {

struct QuadrupedOptions {
  std::optional<double> friction;  ///< zero or positive; unset: 0.3 to 1
};
/// Contacts of a random quadruped (see QuadrupedScene).
ContactProblem quadruped(QuadrupedScene scene, std::uint64_t seed,
                         const QuadrupedOptions& options = {});

/// Which boxes of a stack weigh `mass_ratio` kg; the others weigh 1 kg.
enum class HeavyBoxes {
  kTop,         ///< the top one: the hard case
  kBottom,      ///< the bottom one
  kAlternating  ///< every second one, from the second up
};

struct BoxStackOptions {
  std::optional<int> num_boxes;               ///< 1 to 50; unset: 2 to 5
  double mass_ratio = 1;                      ///< 1 to 1e9
  std::optional<HeavyBoxes> heavy;            ///< unset: any of them
  double size = 0.2;                          ///< edge of the cubes, 1e-3 to 1e3 [m]
  std::optional<std::array<double, 2>> push;  ///< on the top box, along x and y [N]; unset: none in
                                              ///< half of the problems, else up to 1.5 times what
                                              ///< friction holds of its weight
  std::optional<double> noise;     ///< standard deviation of velocities before the step, zero or
                                   ///< positive [m/s]; unset: 0 in half of the problems, else 1e-4
                                   ///< to 0.1
  std::optional<double> friction;  ///< zero or positive; unset: 0.3 to 1
};
/// A stack of cubes on the ground, four corner contacts per interface, from the ground up.
ContactProblem box_stack(std::uint64_t seed, const BoxStackOptions& options = {});

/// A stack of cubes of these masses [kg], from the ground up, the top one pushed along x [N].
ContactProblem box_stack(const std::vector<double>& masses, double friction, double push = 0);

/// What a problem with duplicated contacts is made of.
enum class DuplicatedBase { kStanding, kTrotting, kImpact, kEightResting, kEightImpact, kBoxStack };

struct DuplicatedOptions {
  std::optional<DuplicatedBase> base;  ///< unset: any of them
  std::optional<int> copies;           ///< 2 to 16; unset: 2 or 4
  std::optional<double> friction;      ///< zero or positive; unset: that of the base
};
/// The problem of the same seed of another family, each contact several times.
ContactProblem duplicated_contacts(std::uint64_t seed, const DuplicatedOptions& options = {});

/// Each contact so many times, copies side by side.
ContactProblem duplicate(const ContactProblem& problem, int copies);

struct IllConditionedOptions {
  std::optional<int> num_contacts;  ///< 1 to 100; unset: 2 to 8
  std::optional<double> condition;  ///< largest over smallest nonzero eigenvalue, 1 to 1e12; unset:
                                    ///< any of these, its logarithm uniform
  std::optional<int> rank;          ///< 1 to 3n; unset: 3n/2 to 3n
  std::optional<double> friction;   ///< zero or positive; unset: 0.3 to 1
};
/// G = Y Y^T with random eigenvectors, nonzero eigenvalues of 1 / condition to 1 [1/kg], and c = Y
/// x with x normal: bodies of a kinetic energy of 1/2 J per degree of freedom, in the mean. Some
/// motion of theirs lifts all contacts at once, so that a solution exists.
ContactProblem ill_conditioned(std::uint64_t seed, const IllConditionedOptions& options = {});

struct SpherePileOptions {
  std::optional<int> layers;       ///< 1 to 7; unset: 2 to 5
  double mass_ratio = 1;           ///< masses are 1 to mass_ratio kg, 1 to 1e9
  double irregularity = 0.02;      ///< of radii and centers, over the radius: 0 to 0.2
  std::optional<double> noise;     ///< as in BoxStackOptions
  std::optional<double> friction;  ///< zero or positive; unset: 0.3 to 1
};
/// A pyramid of spheres on a square of layers x layers: each rests on the four below it, neighbors
/// in a layer touch where their irregular radii overlap.
ContactProblem sphere_pile(std::uint64_t seed, const SpherePileOptions& options = {});

struct BrickWallOptions {
  std::optional<int> rows;         ///< 1 to 20; unset: 2 to 6
  std::optional<int> columns;      ///< 1 to 20; unset: 2 to 6
  double mass_ratio = 1;           ///< densities differ by up to this factor, 1 to 1e9
  std::optional<double> noise;     ///< as in BoxStackOptions
  std::optional<double> friction;  ///< zero or positive; unset: 0.3 to 1
};
/// A wall of bricks without mortar, every second row shifted by half a brick and closed by half
/// bricks: four corner contacts where two bricks overlap, 4 columns (2 rows - 1) of them, at most
/// 1000.
ContactProblem brick_wall(std::uint64_t seed, const BrickWallOptions& options = {});

/// A family by name, with the default options.
struct ProblemFamily {
  const char* name;
  ContactProblem (*make)(std::uint64_t seed);
};
/// All families: quadruped_standing, quadruped_trotting, quadruped_impact, eight_contacts_resting,
/// eight_contacts_impact, box_stack, duplicated_contacts, ill_conditioned, sphere_pile, brick_wall.
std::span<const ProblemFamily> problem_families();

/// Problem `seed` of a family. Throws ModelError that lists the families.
ContactProblem random_problem(const std::string& family, std::uint64_t seed);

}  // namespace stickslip::scenes
