// Dense and block-sparse problems are one problem: the same answers, and errors that name the
// place.
#include <stickslip/errors.h>

#include <limits>

#include "check.h"
#include "scenes/problem_families.h"

using namespace stickslip;

namespace {

/// The dense problem as blocks, zero ones left out except on the diagonal.
ContactProblem blocks_of(const ContactProblem& dense) {
  const int n = dense.num_contacts(), m = 3 * n;
  ContactProblem p{{}, dense.free_velocity, dense.friction};
  p.block_starts.assign(1, 0);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      double block[9], sum = 0;
      for (int k = 0; k < 9; ++k) {
        block[k] = dense.delassus[(3 * i + k / 3) * m + 3 * j + k % 3];
        sum += std::fabs(block[k]);
      }
      if (sum == 0 && i != j) continue;
      p.block_columns.push_back(j);
      p.delassus.insert(p.delassus.end(), block, block + 9);
    }
    p.block_starts.push_back(int(p.block_columns.size()));
  }
  return p;
}
ContactProblem dense_of(const ContactProblem& blocks) {
  const int n = blocks.num_contacts(), m = 3 * n;
  ContactProblem p{{}, blocks.free_velocity, blocks.friction};
  p.delassus.resize(std::size_t(m) * m);
  for (int i = 0; i < n; ++i)
    for (int k = blocks.block_starts[i]; k < blocks.block_starts[i + 1]; ++k)
      for (int e = 0; e < 9; ++e)
        p.delassus[std::size_t(3 * i + e / 3) * m + 3 * blocks.block_columns[k] + e % 3] =
            blocks.delassus[9 * std::size_t(k) + e];
  return p;
}
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TEST(BlocksGiveTheResidualsOfTheDenseForm) {
  for (const char* family : {"quadruped_impact", "eight_contacts_impact", "box_stack"})
    for (int seed = 0; seed < 30; ++seed) {
      const ContactProblem dense = scenes::random_problem(family, seed), blocks = blocks_of(dense);
      std::vector<double> impulse(dense.free_velocity.size());
      for (std::size_t i = 0; i < impulse.size(); ++i)
        impulse[i] = 0.1 * double(i % 7) - 0.2 * double(i % 3);
      for (const FrictionLaw law : {FrictionLaw::kCoulomb, FrictionLaw::kMaxDissipation}) {
        const std::vector<double> a = residual(dense, impulse, law),
                                  b = residual(blocks, impulse, law);
        for (std::size_t i = 0; i < a.size(); ++i) CHECK_NEAR(a[i], b[i], 1e-13 * (1 + a[i]));
      }
    }
}

TEST(EveryMethodSolvesBlocksAsItSolvesTheDenseForm) {
  for (const SolveMethod method :
       {SolveMethod::kAuto, SolveMethod::kPerContact, SolveMethod::kPgs, SolveMethod::kProxNewton,
        SolveMethod::kInteriorPoint, SolveMethod::kAdmm})
    for (int seed = 0; seed < 10; ++seed) {
      const ContactProblem dense = scenes::random_problem("quadruped_impact", seed);
      SolveOptions o;
      o.method = method, o.tolerance = 1e-6, o.max_sweeps = 100000;
      const SolveResult a = solve(dense, o), b = solve(blocks_of(dense), o);
      CHECK(a.status == b.status);
      for (std::size_t i = 0; i < a.velocity.size(); ++i)
        CHECK_NEAR(a.velocity[i], b.velocity[i], 1e-4);
    }
}

TEST(ALargeDenseProblemIsSolvedLikeItsBlocks) {
  scenes::BrickWallOptions o;
  o.rows = 5, o.columns = 5;
  const ContactProblem blocks = scenes::brick_wall(0, o), dense = dense_of(blocks);
  CHECK(blocks.is_block_sparse() && !dense.is_block_sparse() && blocks.num_contacts() > 100);
  const SolveResult a = solve(blocks), b = solve(dense);
  CHECK(a.status == SolveStatus::kConverged && b.status == SolveStatus::kConverged);
  CHECK(a.impulse == b.impulse);  // the zero blocks are dropped: the same numbers
}

TEST(AFullLargeProblemIsSolved) {
  // 70 contacts on a body of six dofs: no block is zero, and the system is beyond the own factors.
  scenes::Random rng(3);
  const int n = 70, m = 3 * n;
  std::vector<double> Y(6 * m), u(6);
  for (double& y : Y) y = rng.normal();
  for (double& x : u) x = rng.normal();
  ContactProblem p{std::vector<double>(m * m), std::vector<double>(m), std::vector<double>(n, 0.4)};
  for (int i = 0; i < m; ++i)
    for (int k = 0; k < 6; ++k) {
      p.free_velocity[i] += Y[6 * i + k] * u[k];
      for (int j = 0; j < m; ++j) p.delassus[i * m + j] += Y[6 * i + k] * Y[6 * j + k];
    }
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < i; ++j) p.delassus[i * m + j] = p.delassus[j * m + i];
  const SolveResult r = solve(p);
  std::printf("  residual %.1e, stage %d\n", r.certificate.residual, int(r.stage));
  CHECK(r.status == SolveStatus::kConverged);
}

TEST(BadBlocksAreNamed) {
  const ContactProblem good = blocks_of(scenes::random_problem("quadruped_impact", 0));
  ContactProblem p = good;
  p.block_starts.pop_back();
  CHECK_THROWS(p.validate(), ModelError, "block_starts has 4 values; 5 expected");
  p = good, p.block_starts.back() += 1;
  CHECK_THROWS(p.validate(), ModelError, "block_starts runs from 0 to");
  p = good, p.block_starts[2] = p.block_starts[1] - 1;
  CHECK_THROWS(p.validate(), ModelError, "block_starts[2] is");
  p = good, p.block_starts[1] = 1000;  // beyond the columns: named before anything is read there
  CHECK_THROWS(p.validate(), ModelError, "block_starts[2] is");
  p = good, p.block_columns[1] = 9;
  CHECK_THROWS(p.validate(), ModelError, "block_columns[1] is 9; it must lie in [0, 4)");
  p = good, p.block_columns[1] = p.block_columns[0];
  CHECK_THROWS(p.validate(), ModelError, "columns must ascend");
  p = good, p.delassus.pop_back();
  CHECK_THROWS(p.validate(), ModelError, "delassus has");
  p = good, p.delassus[9 * 1 + 5] = kNan;
  CHECK_THROWS(p.validate(), ModelError, "delassus[1, 5] is nan");
  p = good, p.delassus[9 * 1 + 5] += 1;
  CHECK_THROWS(p.validate(), ModelError, "not symmetric");
  p = good, p.delassus[0] = -1;
  CHECK_THROWS(p.validate(), ModelError, "delassus[0, 0] is -1");
  // Row 0 without its diagonal block.
  p = good;
  p.block_columns.erase(p.block_columns.begin());
  p.delassus.erase(p.delassus.begin(), p.delassus.begin() + 9);
  for (std::size_t i = 1; i < p.block_starts.size(); ++i) --p.block_starts[i];
  CHECK_THROWS(p.validate(), ModelError, "row 0 of blocks has no diagonal block");
}

TEST(LargeIndefiniteProblemsAreRefused) {
  scenes::BrickWallOptions o;
  o.rows = 5, o.columns = 5;
  ContactProblem p = scenes::brick_wall(0, o);
  p.validate();
  // A diagonal block without what its row needs.
  for (int k = p.block_starts[40]; k < p.block_starts[41]; ++k)
    if (p.block_columns[k] == 40)
      for (int r = 0; r < 3; ++r) p.delassus[9 * std::size_t(k) + 4 * r] *= 0.01;
  CHECK_THROWS(p.validate(), ModelError, "indefinite: it has an eigenvalue below -");
}

TEST(AnEmptyBlockSparseProblemIsSolved) {
  ContactProblem p;
  p.block_starts = {0};
  CHECK(solve(p).status == SolveStatus::kConverged);
}
