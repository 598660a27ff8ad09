// From shapes to impulses: which support points take part, their rows, the factored problem, its
// solve. A contact is in the list when any lane needs it; `active` says which lanes do.
#pragma once
#include "collide/support_points.h"
#include "contact/factored.h"
#include "contact/write_out.h"
#include "dynamics/contact_rows.h"
#include "step/overlap_correction.h"
#include "step/step_tables.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

/// A support point that takes part in the solve.
template <class S>
struct ActiveContact {
  int shape;         // index in RobotTables::shapes
  int point;         // of the shape
  int id;            // among all support points of the robot
  Mask<S> active;    // lanes that have it
  Vec3<S> position;  // relative to the base origin, world axes
  S gap;             // [m]
  Vec3<S> velocity;  // of the point before the impulse [m/s]
  Vec3<S> gravity;   // acceleration of the point by gravity alone [m/s^2]
  S shift;  // added to the normal velocity: allowed approach gap / h, less restitution [m/s]
  dynamics::ContactRows<S> rows;
};

/// A link, not body 0, that takes part with several points.
template <class S>
struct TouchingLink {
  int first, end;                            // its contacts
  Mask<S> several;                           // lanes that have two or more of them
  Vec3<S> origin;                            // of the link, relative to the base origin
  dynamics::ContactRows<S> linear, angular;  // of its velocity at the origin
};

/// Lanes in which some contacts are active: one of them, two or more.
template <class S>
struct Occupied {
  Mask<S> once, twice;
};

template <class S>
struct LaneInfo;

template <class S>
class ContactStage {
 public:
  void lay_out(contact::Arena& arena, const RobotTables& tables);

  int count() const { return count_; }
  const ActiveContact<S>& active(int i) const { return active_[i]; }
  void forget() { count_ = 0; }
  /// In these lanes only.
  void forget(Mask<S> lanes);

  /// Takes the points of lanes `live` whose gap is negative ([Hwangbo 2018]). `clearance`: height
  /// of the base origin above the ground.
  void detect_overlapping(const dynamics::Tree<S>& tree, S clearance, Mask<S> live) {
    detect_within(tree, clearance, constant<S>(0), live);
  }
  /// Takes the points that may touch within h: gap < 2 mm + h (approach speed + largest speed of
  /// any shape). Link velocities are those of the free motion.
  void detect_reachable(const dynamics::Tree<S>& tree, S clearance, const Vec3<S>& base_velocity,
                        S h, Mask<S> live);

  /// Velocities of the active points from the link velocities.
  void compute_velocities(const dynamics::Tree<S>& tree, const Vec3<S>& base_velocity);
  /// Speculative contacts: a point at `gap` above the ground may approach with gap / h; one that
  /// overlaps is not pushed out faster than tolerance / h.
  void allow_closing(S h, double tolerance);
  /// Accelerations of the points by gravity: the same for all (a floating base falls as a whole),
  /// or from the link velocities, which then hold the acceleration by gravity.
  void set_gravity(const Vec3<S>& gravity);
  void take_gravity(const dynamics::Tree<S>& tree);
  /// Newton's restitution where the gap closes within h. Approach speeds are taken before gravity's
  /// part of the kick, which lasted `fall` [s].
  void add_restitution(S fall, S h);
  /// Rows and the factored problem; friction per shape. `with_x`: free velocities come from J u + Y
  /// x with the tree's x; otherwise from J u.
  void build_problem(dynamics::Tree<S>& tree, const S* friction, bool with_x);
  /// Where the solve starts, to be called before it: at the forces of the last one (3 per support
  /// point), impulse = force * h, or at zero if there are none. Given those of the one `earlier`,
  /// their change goes on where a point pushed both times.
  void start_at(const S* last, const S* earlier, S h);
  /// Solves, in these lanes; what it took goes to `info`.
  void solve(const StepSettings& settings, Mask<S> live, LaneInfo<S>& info);
  /// The solution as forces of all points, for the lanes that were live: impulse = force * h.
  void write_forces(Mask<S> live, S h, S* forces) const;
  /// Adds Y^T lambda to the tree's x in these lanes.
  void add_impulses(dynamics::Tree<S>& tree, Mask<S> lanes) const;
  /// Lanes with a contact that pushes.
  Mask<S> any_impulse() const;
  /// sum lambda . (acceleration of the contact point by gravity) [J/s].
  S work_rate_of_gravity() const;
  /// Energy the impulses gave, sum lambda . (c + G lambda / 2), with c the free velocity before the
  /// shift [J].
  S work() const;

  const S* impulse(int i) const { return problem_.contact(i).impulse; }
  S friction(int i) const { return problem_.contact(i).friction; }
  Vec3<S> velocity_after(int i) const {
    const S* v = problem_.velocity(i);
    return {v[0], v[1], v[2] - active_[i].shift};
  }
  const contact::FactoredProblem<S>& problem() const { return problem_; }

  /// Displacement that moves overlapping points of the solve to the surface, at the tree's present
  /// positions, into the tree's x; the lanes in which there is something to do.
  Mask<S> correct_overlap(dynamics::Tree<S>& tree, S clearance, double tolerance);

 private:
  static constexpr double kReach = 2e-3;  // candidates this near take part whatever their speed [m]
  static constexpr int kLanes = dynamics::Tree<S>::kLanes;
  static int flat(dynamics::LinkIndex link) { return link.slot * kLanes + link.lane; }
  int links() const { return tables_->num_slots * kLanes; }

  /// Number of a link's joint among the shared dofs; -1: private in all lanes.
  int shared_dof(dynamics::LinkIndex link) const { return num_shared_ ? dof_[flat(link)] : -1; }

  void add(int shape, int point, const Vec3<S>& position, S gap, Mask<S> active);
  /// Takes the points lower than `reach` above the ground.
  void detect_within(const dynamics::Tree<S>& tree, S clearance, S reach, Mask<S> live);
  S fastest_shape(const dynamics::Tree<S>& tree, const Vec3<S>& base_velocity) const;
  void compute_rows(const dynamics::Tree<S>& tree);
  Occupied<S> occupied(int first, int end) const;
  /// The link of the contacts [first, end), if a lane has several of them; else null.
  const TouchingLink<S>* add_link(const dynamics::Tree<S>& tree, int first, int end);
  /// Whether no two of the points in the list can have a joint in common.
  bool apart() const;
  /// The first contact after i that is on another body.
  int next_link(int i) const;
  void find_shared_joints();
  void number_shared_dofs(const dynamics::Tree<S>& tree);
  void add_body(const TouchingLink<S>& link);
  void fill_contact(const dynamics::Tree<S>& tree, const ActiveContact<S>& a, const S* friction,
                    bool with_x);
  HostSolver::Effort ask_host(const HostSolver& host, contact::FactoredProblem<double>& p,
                              double tolerance);
  void solve_by_method(const HostSolver& host, LaneInfo<S>& info);
  void solve_by_chain(const HostSolver& host, Mask<S> lanes, double tolerance, LaneInfo<S>& info);

  const RobotTables* tables_;
  ActiveContact<S>* active_;
  int count_ = 0;
  TouchingLink<S>* touching_;
  int num_touching_ = 0;
  // Joints above active contacts, per slot and lane of a bundle; unset where there are no shared
  // dofs.
  Mask<S>*once_, *shared_;  // lanes where one contact, two or more of them are below
  Mask<S>* common_;         // lanes where contacts of two or more bodies are below
  int* dof_;                // see shared_dof
  dynamics::LinkIndex* link_of_dof_;
  int num_shared_ = 0;
  int* index_;
  bool* odd_;  // parity of each dof of the base and of the depth of each shared joint
  contact::FactoredProblem<S> problem_;
  OverlapCorrection<S> overlap_;
  double* dense_;  // a problem for the host
};

}  // namespace stickslip::step::inline STICKSLIP_KERNELS

#include "step/contact_problem.inl"
