#include "solvers/chain.h"

#include <algorithm>
#include <cmath>

#include "solvers/admm.h"
#include "solvers/interior_point.h"
#include "solvers/islands.h"
#include "solvers/prox_newton.h"
#include "solvers/recorded_sweeps.h"

namespace stickslip::solvers {
namespace {

using contact::ExplicitProblem;

/// One visit of contact i, (C4) to (C9): its exact impulse with the others held, a sliding one by a
/// single Halley step from its last direction, since the sweep will come back. Returns the squared
/// velocity change.
double visit(ExplicitProblem& p, int i, double speed, double direction[2]) {
  const contact::LocalContact<double>& k = p.local[i];
  double c[3], next[3];
  contact::velocity_without_own(p, i, c);
  if (contact::is_singular(k)) [[unlikely]] {
    const contact::SlipSolution s =
        contact::solve_single<contact::Method::kHalley, false>(k, c, speed);
    next[0] = s.x, next[1] = s.y, next[2] = s.z;
  } else {
    const contact::Reduced<double> r = contact::reduce(k, c[0], c[1], c[2]);
    if (r.slip) {
      next[0] = next[1] = 0, next[2] = r.a;
      if (k.mu > 0) contact::visit_slip<false>(k, r, speed, direction, next);
    } else {
      next[0] = r.stick ? r.x : 0, next[1] = r.stick ? r.y : 0, next[2] = r.stick ? r.z : 0;
    }
  }
  const double* l = p.lambda + 3 * i;
  const double d[3] = {next[0] - l[0], next[1] - l[1], next[2] - l[2]};
  const double size = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  if (size > 0) contact::add_impulse(p, i, d);
  return size * k.scale * k.scale;
}

/// The best impulse of all stages may still be worse than none.
void offer_rest(ExplicitProblem& p, BestImpulse& best) {
  std::fill(p.lambda, p.lambda + 3 * p.n, 0.0);
  best.offer(p, SolveStage::kStart);
}

class Chain {
 public:
  Chain(ExplicitProblem& p, BestImpulse& best, int max_sweeps, Effort& effort,
        Memory memory = std::pmr::get_default_resource())
      : p_(p),
        best_(best),
        max_sweeps_(max_sweeps),
        effort_(effort),
        memory_(memory),
        directions_(2 * std::size_t(p.n), memory),
        newton_(p, memory) {}

  void run_brief() {
    if (proximal_newton(best_.impulse(), 1e-3, 60)) return;
    interior_point(ShiftRule::kExact, 80);
  }
  void run() {
    if (p_.n <= kRobotSized ? sweeps_with_newton() : patient_sweeps()) return;
    // What is left is hyperstatic, ill-conditioned or large.
    if (separate_islands()) return;
    if (proximal_newton(best_.impulse(), 1e-3, steps(60))) return;
    // On many contacts its iterations are cheap beside an interior-point step.
    if (p_.n > kRobotSized && admm(admm_iterations() / 10)) return;
    for (const ShiftRule shift : {ShiftRule::kExact, ShiftRule::kLagged, ShiftRule::kDamped})
      if (interior_point(shift, steps(80))) return;
    if (admm(admm_iterations())) return;
    for (const double alpha : {1e-1, 1e-5, 1e-2}) {
      if (stubborn_sweeps(alpha < 1e-3 ? 1 : 0.7)) return;
      if (proximal_newton(best_.impulse(), alpha, steps(150))) return;
    }
    proximal_newton(Doubles(3 * p_.n), 1.0, steps(150));
    offer_rest(p_, best_);
  }

 private:
  /// Steps that a stage may take: a problem that nothing solves should not take minutes. A
  /// factorization of a full matrix costs with the cube of its rows; block-sparse ones cost far
  /// less.
  int steps(int most) const {
    const double all = double(p_.n) * p_.n, rows = 3.0 * p_.n;
    if (p_.n <= kRobotSized || (p_.starts && p_.starts[p_.n] < 0.5 * all)) return most;
    return std::max(8, int(most * std::min(1.0, 1e8 / (rows * rows * rows))));
  }
  /// An iteration costs two triangular solves and one product.
  int admm_iterations() const {
    if (p_.n <= kRobotSized) return 2000;
    const double blocks = p_.starts ? p_.starts[p_.n] : double(p_.n) * p_.n;
    return int(std::clamp(6e7 / blocks, 200.0, 20000.0));
  }

  /// Contacts that do not couple, even through others, are solved apart: a hard island does not
  /// hold up easy ones. True if there was more than one island; then each has had its turn.
  bool separate_islands() {
    const Islands islands(p_);
    if (islands.count() < 2) return false;
    best_.restore(p_);
    const std::vector<double> start(p_.lambda, p_.lambda + 3 * p_.n);
    std::vector<double> composed = start;
    const SolveStage began = best_.stage();
    SolveStage stage = began;
    for (int k = 0; k < islands.count(); ++k) {
      const std::vector<int> contacts = islands.contacts(k);
      if (is_solved(contacts)) continue;
      const Island island(p_, contacts);
      BestImpulse best(best_.tolerance(), false, nullptr);
      best.offer(island.view(), began);  // so that no island ends worse than it began
      Chain(island.view(), best, max_sweeps_, effort_).run();
      stage = std::max(stage, best.stage());
      for (std::size_t a = 0; a < contacts.size(); ++a)
        std::copy_n(best.impulse().begin() + 3 * a, 3, composed.begin() + 3 * contacts[a]);
      if (best_.records()) {
        std::copy(composed.begin(), composed.end(), p_.lambda);
        contact::refresh_velocity(p_);
        best_.record(best.stage(), reachable_residual(p_, false));
        std::copy(start.begin(), start.end(), p_.lambda);
        contact::refresh_velocity(p_);
      }
    }
    std::copy(composed.begin(), composed.end(), p_.lambda);
    best_.replace(p_, stage);
    return true;
  }
  bool is_solved(const std::vector<int>& contacts) const {
    for (const int i : contacts)
      if (p_.local[i].inv_zz > 0 && !(contact_residual(p_, i, false) <= best_.tolerance()))
        return false;
    return true;
  }

  /// The largest velocity change of a sweep [m/s].
  double sweep() {
    const double speed = 0.01 * best_.tolerance();
    double change = 0;
    for (int i = 0; i < p_.n; ++i)
      change = std::max(change, visit(p_, i, speed, directions_.data() + 2 * i));
    ++effort_.sweeps;
    change = std::sqrt(change);
    if (best_.records()) best_.record(SolveStage::kSweeps, reachable_residual(p_, false));
    return change;
  }

  /// Sweeps, and Newton steps where the next sweep is not expected to converge.
  bool sweeps_with_newton() {
    constexpr int kMost = 16;
    const double tolerance = best_.tolerance();
    double before = INFINITY;
    for (int k = 1; k <= kMost && k <= max_sweeps_; ++k) {
      const double change = sweep();
      if (change <= tolerance && best_.offer(p_, SolveStage::kSweeps, true)) return true;
      if (k >= 2 && (k >= 5 || change * change > tolerance * before)) {
        ++effort_.newton_steps;
        // Late steps are more cautious.
        if (newton_.step(k < 8 ? 1e-6 : 1e-5) && best_.offer(p_, SolveStage::kNewton)) return true;
      }
      before = change;
    }
    return best_.offer(p_, SolveStage::kSweeps);
  }

  /// Sweeps for as long as a block of them is worth it. A sweep of a large problem costs a
  /// hundredth of a Newton step.
  bool patient_sweeps() {
    constexpr int kBlock = 25;
    constexpr double kGain = 0.7;
    double last = INFINITY;
    for (int k = 1; k <= max_sweeps_; ++k) {
      const double change = sweep();
      if (k % kBlock != 0 && change > best_.tolerance()) continue;
      if (best_.offer(p_, SolveStage::kSweeps, true)) return true;
      if (k % kBlock != 0) continue;
      if (!(best_.last_residual() < kGain * last)) break;
      last = best_.last_residual();
    }
    return best_.offer(p_, SolveStage::kSweeps, true);
  }

  /// Relaxed or plain, from the best impulse, whether or not they seem to gain.
  bool stubborn_sweeps(double relaxation) {
    best_.restore(p_);
    contact::SweepOptions o;
    o.tolerance = best_.tolerance();
    o.max_sweeps = max_sweeps_;
    o.alpha = relaxation;
    effort_.sweeps += recorded_sweeps(p_, o, best_, false).sweeps;
    return best_.offer(p_, SolveStage::kSweeps, true);
  }

  bool proximal_newton(const Doubles& start, double alpha, int steps) {
    std::copy(start.begin(), start.end(), p_.lambda);
    const int before = newton_.steps();
    const bool solved = newton_.run(best_, alpha, steps);
    effort_.newton_steps += newton_.steps() - before;
    return solved;
  }
  /// Small weights keep what a method has found out about which contacts are open, stick and slide.
  bool polish() {
    const Doubles end(p_.lambda, p_.lambda + 3 * p_.n, memory_);
    return proximal_newton(end, 1e-8, steps(40)) || proximal_newton(end, 1e-5, steps(40));
  }

  bool interior_point(ShiftRule shift, int most) {
    InteriorPoint method(p_, memory_);
    const bool solved = method.run(best_, shift, most);
    effort_.interior_point_steps += method.iterations();
    return solved || polish();
  }

  /// From rest: its start owes nothing to what the others have found, and it is often better so.
  bool admm(int iterations) {
    std::fill(p_.lambda, p_.lambda + 3 * p_.n, 0.0);
    Admm method(p_);
    const bool solved = method.run(best_, iterations);
    effort_.admm_iterations += method.iterations();
    return solved || polish();
  }

  ExplicitProblem& p_;
  BestImpulse& best_;
  int max_sweeps_;
  Effort& effort_;
  Memory memory_;
  Doubles directions_;
  ProxNewton newton_;
};

void run_max_dissipation(ExplicitProblem& p, BestImpulse& best, int max_sweeps, Effort& effort) {
  contact::SweepOptions o;
  o.max_dissipation = true;
  o.tolerance = best.tolerance();
  o.max_sweeps = max_sweeps;
  for (const double alpha : {1.0, 0.7}) {
    if (alpha < 1) best.restore(p);
    o.alpha = alpha;
    effort.sweeps += recorded_sweeps(p, o, best, false).sweeps;
    if (best.offer(p, SolveStage::kSweeps, true)) return;
  }
  offer_rest(p, best);
}

}  // namespace

void run_chain(ExplicitProblem& p, BestImpulse& best, int max_sweeps, Effort& effort,
               Memory memory) {
  if (p.n == 0) return;
  if (best.max_dissipation())
    run_max_dissipation(p, best, max_sweeps, effort);
  else
    Chain(p, best, max_sweeps, effort, memory).run();
}

std::size_t brief_chain_bytes(int contacts) {
  // Vectors of the chain, Newton and interior point (about 150 per contact), their two systems,
  // padding.
  const std::size_t n = contacts, rows = 3 * n;
  return sizeof(double) * (160 * n + 2 * (rows * (rows + 8) + 8)) + 4096;
}

void run_brief_chain(ExplicitProblem& p, BestImpulse& best, Effort& effort, Memory memory) {
  Chain(p, best, 1, effort, memory).run_brief();
}

}  // namespace stickslip::solvers
