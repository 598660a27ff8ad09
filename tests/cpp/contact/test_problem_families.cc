// The generated families: a seed is a problem, options do what they say, everything is solvable.
#include <stickslip/errors.h>

#include "check.h"
#include "contact/dense_problems.h"

using namespace stickslip;
using scenes::BoxStackOptions;

namespace {

bool same(const ContactProblem& a, const ContactProblem& b) {
  return a.delassus == b.delassus && a.free_velocity == b.free_velocity && a.friction == b.friction;
}

}  // namespace

TEST(ASeedIsAProblemAndProblemsAreValid) {
  for (const auto& family : scenes::problem_families())
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      const ContactProblem p = scenes::random_problem(family.name, seed);
      CHECK(p.num_contacts() > 0);
      p.validate();
      CHECK(same(p, family.make(seed)));
      CHECK(!same(p, family.make(seed + 1)));
    }
}

TEST(AutoSolvesTheSmallFamilies) {
  for (const auto& family : scenes::problem_families()) {
    const std::string name = family.name;
    if (name == "sphere_pile" || name == "brick_wall" || name == "ill_conditioned") continue;
    int unconverged = 0, contacts = 0, sweeps = 0;
    constexpr int kCount = 100;
    for (std::uint64_t seed = 0; seed < kCount; ++seed) {
      const ContactProblem p = family.make(seed);
      SolveOptions o;
      o.tolerance = 1e-8 * problems::largest(p.free_velocity);
      const SolveResult r = solve(p, o);
      unconverged += r.status != SolveStatus::kConverged;
      contacts += p.num_contacts(), sweeps += r.sweeps;
    }
    std::printf("  %-22s contacts %5.1f, sweeps %6.1f, unconverged %d of %d\n", family.name,
                double(contacts) / kCount, double(sweeps) / kCount, unconverged, kCount);
    CHECK(unconverged == 0);
  }
}

TEST(AnOptionChangesNothingElseThanItself) {
  BoxStackOptions light, heavy;
  heavy.mass_ratio = 4, heavy.heavy = scenes::HeavyBoxes::kBottom;
  light.num_boxes = heavy.num_boxes = 3;
  light.push = heavy.push = std::array<double, 2>{0, 0};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const ContactProblem a = scenes::box_stack(seed, light), b = scenes::box_stack(seed, heavy);
    CHECK(a.free_velocity == b.free_velocity && a.friction == b.friction);
    CHECK_NEAR(b.delassus[0], a.delassus[0] / 4, 1e-15);  // the lowest box on the ground
    CHECK(b.delassus.back() == a.delassus.back());        // the top one on the one below
  }
}

TEST(CopiesOfAContactHaveItsBlocks) {
  const ContactProblem p = scenes::box_stack(std::vector<double>{1, 5}, 0.5, 1),
                       d = scenes::duplicate(p, 3);
  CHECK(d.num_contacts() == 3 * p.num_contacts());
  for (int i = 0; i < d.num_contacts(); ++i)
    for (int j = 0; j < d.num_contacts(); ++j)
      for (int k = 0; k < 9; ++k)
        CHECK(d.delassus[(3 * i + k / 3) * 3 * d.num_contacts() + 3 * j + k % 3] ==
              p.delassus[(3 * (i / 3) + k / 3) * 3 * p.num_contacts() + 3 * (j / 3) + k % 3]);
}

TEST(BadOptionsAreNamedWithTheirRange) {
  BoxStackOptions box;
  box.num_boxes = 0;
  CHECK_THROWS(scenes::box_stack(0, box), ModelError, "num_boxes is 0; it must lie in [1, 50]");
  box = {}, box.mass_ratio = 0.5;
  CHECK_THROWS(scenes::box_stack(0, box), ModelError,
               "mass_ratio is 0.5; it must lie in [1, 1e+09]");
  box = {}, box.friction = -1;
  CHECK_THROWS(scenes::box_stack(0, box), ModelError,
               "friction is -1; it must be zero or positive");
  box = {}, box.noise = std::nan("");
  CHECK_THROWS(scenes::box_stack(0, box), ModelError, "noise is nan");
  box = {}, box.push = std::array<double, 2>{0, INFINITY};
  CHECK_THROWS(scenes::box_stack(0, box), ModelError, "push[1] is inf");
  scenes::IllConditionedOptions ill;
  ill.num_contacts = 2, ill.rank = 7;
  CHECK_THROWS(scenes::ill_conditioned(0, ill), ModelError, "rank is 7; it must lie in [1, 6]");
  scenes::BrickWallOptions wall;
  wall.rows = 20, wall.columns = 20;
  CHECK_THROWS(scenes::brick_wall(0, wall), ModelError, "3120 contacts");
  scenes::DuplicatedOptions copies;
  copies.copies = 1;
  CHECK_THROWS(scenes::duplicated_contacts(0, copies), ModelError, "copies is 1");
  CHECK_THROWS(scenes::random_problem("towers", 0), ModelError,
               "family is 'towers'; choose one of 'quadruped_standing'");
}
