// From shapes to impulses: which support points take part, their rows, the factored problem, its
// solve.
#pragma once
#include <stickslip/world.h>

#include <memory>
#include <vector>

#include "collide/ground_shapes.h"
#include "contact/explicit_problem.h"
#include "contact/factored.h"
#include "dynamics/contact_rows.h"
#include "dynamics/tree_memory.h"
#include "step/overlap_correction.h"

namespace stickslip::step {

/// A support point that takes part in the solve.
struct ActiveContact {
  int shape;              // index in ContactStage::shapes()
  int point;              // of the shape
  int id;                 // among all support points of the robot
  Vec3<double> position;  // relative to the base origin, world axes
  double gap;             // [m]
  Vec3<double> velocity;  // of the point before the impulse [m/s]
  Vec3<double> gravity;   // acceleration of the point by gravity alone [m/s^2]
  double shift;  // added to the normal velocity: allowed approach gap / h, less restitution [m/s]
  dynamics::ContactRows<double> rows;
};

class ContactStage {
 public:
  ContactStage(const Model& model, const dynamics::TreeLayout& layout, int max_depth);

  const std::vector<collide::GroundShape>& shapes() const { return shapes_; }
  int num_points() const { return num_points_; }
  /// Contact law per shape of `shapes()`.
  std::vector<MaterialPair>& laws() { return laws_; }
  const MaterialPair& law(int shape) const { return laws_[shape]; }

  /// Takes the points whose gap is negative ([Hwangbo 2018]). `clearance`: height of the base
  /// origin above the ground.
  void detect_overlapping(const dynamics::Tree<double>& tree, double clearance);
  /// Takes the points that may touch within h: gap < 2 mm + h (approach speed + largest speed of
  /// any shape). Link velocities are those of the free motion.
  void detect_reachable(const dynamics::Tree<double>& tree, double clearance,
                        const Vec3<double>& base_velocity, double h);
  int count() const { return count_; }
  /// Numbers that a dense problem takes.
  static size_t dense_size(int contacts);
  ActiveContact& active(int i) { return active_[i]; }
  const ActiveContact& active(int i) const { return active_[i]; }
  void forget() { count_ = 0; }

  /// Velocities of the active points from the link velocities.
  void compute_velocities(const dynamics::Tree<double>& tree, const Vec3<double>& base_velocity);
  /// Speculative contacts: a point at `gap` above the ground may approach with gap / h; one that
  /// overlaps is not pushed out faster than tolerance / h.
  void allow_closing(double h, double tolerance);
  /// Accelerations of the points by gravity: the same for all (a floating base falls as a whole),
  /// or from the link velocities, which then hold the acceleration by gravity.
  void set_gravity(const Vec3<double>& gravity);
  void take_gravity(const dynamics::Tree<double>& tree);
  /// Newton's restitution where the gap closes within h. Approach speeds are taken before gravity's
  /// part of the kick, which lasted `fall` [s].
  void add_restitution(double fall, double h);
  /// Rows and the factored problem. `with_x`: free velocities come from J u + Y x with the tree's
  /// x; otherwise from J u.
  void build_problem(dynamics::Tree<double>& tree, bool with_x);
  /// Solves; `warm` (3 per support point) is in and out, in force units: impulse = force * h.
  void solve(const StepSolverOptions& options, double* warm, double h, StepInfo& info);
  /// Adds Y^T lambda to the tree's x.
  void add_impulses(dynamics::Tree<double>& tree) const;
  bool any_impulse() const;
  /// sum lambda . (acceleration of the contact point by gravity) [J/s].
  double work_rate_of_gravity() const;
  /// Energy the impulses gave, sum lambda . (c + G lambda / 2), with c the free velocity before the
  /// shift [J].
  double work() const;

  const double* impulse(int i) const { return problem_.contact(i).impulse; }
  Vec3<double> velocity_after(int i) const {
    const double* v = problem_.velocity(i);
    return {v[0], v[1], v[2] - active_[i].shift};
  }
  /// Memory for the methods that need the dense problem; call once before the first such solve.
  void reserve_explicit();
  /// The problem written out, dense.
  ContactProblem explicit_problem() const;

  /// Displacement that moves overlapping points of the solve to the surface, at the tree's present
  /// positions, into the tree's x; false if there is nothing to do.
  bool correct_overlap(dynamics::Tree<double>& tree, double clearance, double tolerance);

 private:
  void add(int shape, int point, const Vec3<double>& position, double gap);
  /// Takes the points lower than `reach` above the ground.
  void detect_within(const dynamics::Tree<double>& tree, double clearance, double reach);
  void solve_explicit(const StepSolverOptions& options, StepInfo& info);
  /// Where the factored solver ends above its tolerance [m/s]: the first stages of the chain of
  /// `stickslip::solve` on the dense problem. True, with its answer in place, if that is solved.
  bool solve_by_chain(double tolerance, StepInfo& info);
  /// The factored problem as a dense one with its impulses, prepared, in `dense_size` numbers.
  contact::ExplicitProblem dense_problem(double* memory) const;

  std::vector<collide::GroundShape> shapes_;
  std::vector<collide::PlacedShape> placed_;
  std::vector<MaterialPair> laws_;
  int num_points_, num_dofs_;
  bool floating_;
  std::vector<ActiveContact> active_;
  int count_ = 0;
  std::vector<dynamics::LinkIndex> paths_;
  std::vector<Row3<double>> rows_;
  std::vector<int> uses_, shared_dof_;       // per slot and lane
  std::vector<dynamics::LinkIndex> shared_;  // joints that several contacts share
  int num_shared_ = 0;
  std::vector<int> index_;
  std::unique_ptr<char, void (*)(char*)> memory_;
  std::unique_ptr<char, void (*)(char*)> chain_memory_;
  contact::FactoredProblem<double> problem_;
  OverlapCorrection overlap_;
  std::vector<double> dense_;
};

}  // namespace stickslip::step
