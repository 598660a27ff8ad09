// The chain behind method "auto" (docs/theory/solvers.md, section 7): cheap methods first, each
// stage starting where the best impulse so far lies, until one meets the tolerance.
#pragma once
#include "solvers/best_impulse.h"
#include "solvers/block_system.h"

namespace stickslip::solvers {

/// What a solve took.
struct Effort {
  int sweeps = 0, newton_steps = 0, interior_point_steps = 0, admm_iterations = 0;
};

/// Improves `best` on a prepared problem, starting at p.lambda, until it is solved or every stage
/// has had its turn. Coulomb's law: sweeps with a Newton finish, proximal Newton, interior point,
/// ADMM. Maximum dissipation is no complementarity problem in the velocity: sweeps, plain and
/// relaxed, at most `max_sweeps` each.
void run_chain(contact::ExplicitProblem& p, BestImpulse& best, int max_sweeps, Effort& effort,
               Memory memory = std::pmr::get_default_resource());

/// Contacts up to which a Newton step costs about as much as a few sweeps, and own factors serve.
inline constexpr int kRobotSized = BlockSystem::kDenseRows / 3;

/// The stages that a step of a simulation can wait for, after its own solver: proximal Newton and
/// one interior point. Coulomb's law, at most kRobotSized contacts; takes no memory but `memory`,
/// of at most `brief_chain_bytes`.
void run_brief_chain(contact::ExplicitProblem& p, BestImpulse& best, Effort& effort, Memory memory);
std::size_t brief_chain_bytes(int contacts);

}  // namespace stickslip::solvers
