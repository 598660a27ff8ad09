#include "step/contact_stage.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>

#include "contact/method_of.h"
#include "contact/per_contact.h"
#include "contact/pgs.h"
#include "contact/write_out.h"
#include "solvers/chain.h"

namespace stickslip::step {
namespace {

using dynamics::kBaseSlot;
using dynamics::kMaxLanes;
using dynamics::LinkIndex;
using dynamics::Tree;

constexpr double kReach = 2e-3;  // candidates this near take part whatever their speed [m]

int flat(LinkIndex link) { return link.slot * kMaxLanes + link.lane; }

char* aligned_block(long bytes) {
  return static_cast<char*>(::operator new(static_cast<size_t>(bytes), std::align_val_t(64)));
}
/// Of `solve_by_chain`: the dense problem, its best impulse, the chain.
size_t chain_bytes(int contacts) {
  return sizeof(double) * (ContactStage::dense_size(contacts) + 3 * size_t(contacts)) +
         solvers::brief_chain_bytes(contacts);
}
void free_block(char* block) { ::operator delete(block, std::align_val_t(64)); }

}  // namespace

ContactStage::ContactStage(const Model& model, const dynamics::TreeLayout& layout, int max_depth)
    : shapes_(collide::ground_shapes(model, layout)),
      placed_(shapes_.size()),
      laws_(shapes_.size()),
      num_points_(collide::total_points(shapes_)),
      num_dofs_(layout.num_joints + 6),
      floating_(layout.floating),
      active_(num_points_),
      paths_(static_cast<size_t>(num_points_) * max_depth),
      rows_(static_cast<size_t>(num_points_) * max_depth),
      uses_(layout.num_slots * kMaxLanes, 0),
      shared_dof_(layout.num_slots * kMaxLanes, -1),
      shared_(layout.num_joints),
      index_(num_dofs_),
      memory_(nullptr, free_block),
      chain_memory_(nullptr, free_block),
      overlap_(num_points_, num_dofs_) {
  const contact::FactoredCapacity capacity{std::max(num_points_, 1), num_dofs_};
  memory_.reset(aligned_block(contact::FactoredProblem<double>::required_bytes(capacity)));
  chain_memory_.reset(
      aligned_block(long(chain_bytes(std::min(num_points_, solvers::kRobotSized)))));
  problem_.attach(memory_.get(), capacity);
  for (int i = 0; i < num_points_; ++i) {
    active_[i].rows.path = paths_.data() + static_cast<size_t>(i) * max_depth;
    active_[i].rows.joint = rows_.data() + static_cast<size_t>(i) * max_depth;
  }
}

void ContactStage::reserve_explicit() { dense_.resize(dense_size(num_points_)); }

// ---- which points take part

void ContactStage::add(int shape, int point, const Vec3<double>& position, double gap) {
  ActiveContact& a = active_[count_++];
  a.shape = shape;
  a.point = point;
  a.id = shapes_[shape].first_point + point;
  a.position = position;
  a.gap = gap;
  a.shift = 0;
  a.gravity = zero3<double>();
}

void ContactStage::detect_within(const Tree<double>& tree, double clearance, double reach) {
  count_ = 0;
  for (int s = 0; s < static_cast<int>(shapes_.size()); ++s) {
    placed_[s] = collide::place(tree, shapes_[s]);
    if (!(placed_[s].lowest + clearance < reach)) continue;
    for (int k = 0; k < shapes_[s].num_points; ++k) {
      const Vec3<double> p = collide::support_point(shapes_[s], placed_[s], k);
      if (p.z + clearance < reach) add(s, k, p, p.z + clearance);
    }
  }
}

void ContactStage::detect_overlapping(const Tree<double>& tree, double clearance) {
  detect_within(tree, clearance, 0);
}

void ContactStage::detect_reachable(const Tree<double>& tree, double clearance,
                                    const Vec3<double>& base_velocity, double h) {
  // The fastest point of any shape may not outrun the list: impulses couple the links.
  double fastest = 0;
  for (const collide::GroundShape& s : shapes_) {
    const Spatial<double> v =
        s.link.slot == kBaseSlot
            ? tree.base.velocity
            : dynamics::field_of<double, Spatial>(
                  tree, s.link, &dynamics::LinkState<dynamics::Wide<double>>::velocity);
    const Vec3<double> center = dynamics::point_position(tree, s.link, s.center);
    const Vec3<double> at_center = cross(v.ang, center, v.lin + base_velocity);
    fastest = std::max(fastest, std::sqrt(dot(at_center, at_center)) +
                                    std::sqrt(dot(v.ang, v.ang)) * s.bounding_radius);
  }
  detect_within(tree, clearance, kReach + 2 * h * fastest);
  // The rows are those of the points on the plane below: a gap then closes without a tangential
  // velocity of its own, and the allowed approach of coplanar points is one rigid motion.
  for (int i = 0; i < count_; ++i) active_[i].position.z = -clearance;
  compute_velocities(tree, base_velocity);
  int kept = 0;
  for (int i = 0; i < count_; ++i) {
    const ActiveContact& a = active_[i];
    if (!(a.gap < kReach + h * (std::max(0.0, -a.velocity.z) + fastest))) continue;
    if (kept != i) {
      const dynamics::ContactRows<double> rows = active_[kept].rows;  // memory stays with its place
      active_[kept] = a;
      active_[kept].rows = rows;
    }
    ++kept;
  }
  count_ = kept;
}

void ContactStage::compute_velocities(const Tree<double>& tree, const Vec3<double>& base_velocity) {
  for (int i = 0; i < count_; ++i)
    active_[i].velocity =
        dynamics::point_velocity(tree, shapes_[active_[i].shape].link, active_[i].position) +
        base_velocity;
}

void ContactStage::allow_closing(double h, double tolerance) {
  // Within the tolerance an overlap counts like a gap. Clamped at zero, the gaps of coplanar points
  // would no longer be those of one rigid motion, and the problem would be nearly contradictory.
  for (int i = 0; i < count_; ++i) active_[i].shift = std::max(active_[i].gap, -tolerance) / h;
}

void ContactStage::set_gravity(const Vec3<double>& gravity) {
  for (int i = 0; i < count_; ++i) active_[i].gravity = gravity;
}

void ContactStage::take_gravity(const Tree<double>& tree) {
  for (int i = 0; i < count_; ++i)
    active_[i].gravity =
        dynamics::point_velocity(tree, shapes_[active_[i].shape].link, active_[i].position);
}

void ContactStage::add_restitution(double fall, double h) {
  for (int i = 0; i < count_; ++i) {
    ActiveContact& a = active_[i];
    const MaterialPair& law = laws_[a.shape];
    const double kick = fall * a.gravity.z, before = a.velocity.z - kick;
    // The rebound is kicked like any motion: with e = 1 a ball keeps its energy. Not into the
    // ground.
    if (law.restitution > 0 && -before > law.restitution_threshold && a.gap + h * a.velocity.z < 0)
      a.shift = std::min(law.restitution * before - kick, std::max(0.0, a.gap) / h);
  }
}

// ---- the factored problem

void ContactStage::build_problem(Tree<double>& tree, bool with_x) {
  for (int i = 0; i < count_; ++i) {
    ActiveContact& a = active_[i];
    dynamics::compute_contact_rows(tree, shapes_[a.shape].link, a.position, a.rows);
    for (int k = 0; k < a.rows.depth; ++k) ++uses_[flat(a.rows.path[k])];
  }
  // Joints on several paths are shared dofs, numbered from the base outward, contact by contact.
  const int base_dofs = floating_ ? 6 : 0;
  int num_shared = 0;
  for (int i = 0; i < count_; ++i)
    for (int k = active_[i].rows.depth - 1; k >= 0; --k) {
      const LinkIndex link = active_[i].rows.path[k];
      if (uses_[flat(link)] < 2 || shared_dof_[flat(link)] >= 0) continue;
      shared_dof_[flat(link)] = base_dofs + num_shared;
      shared_[num_shared++] = link;
    }
  num_shared_ = num_shared;
  problem_.clear(base_dofs + num_shared);
  const auto x_of = [&](LinkIndex link) { return get_lane(tree.links[link.slot].x, link.lane); };
  if (with_x) {
    for (int k = 0; k < base_dofs; ++k) problem_.w0[k] = tree.base.x[k];
    for (int k = 0; k < num_shared; ++k) problem_.w0[base_dofs + k] = x_of(shared_[k]);
  }
  for (int i = 0; i < count_; ++i) {
    const ActiveContact& a = active_[i];
    const int c = problem_.add();
    Row3<double>* y = problem_.y(c);
    for (int k = 0; k < base_dofs; ++k) y[k] = a.rows.base[k], index_[k] = k;
    int touched = base_dofs;
    Row3<double> offset = make_row3(a.velocity.x, a.velocity.y, a.velocity.z + a.shift);
    Row3<double> own[3];  // columns of the private block
    for (auto& column : own) column = make_row3(0.0, 0.0, 0.0);
    for (int k = a.rows.depth - 1; k >= 0; --k) {
      const LinkIndex link = a.rows.path[k];
      const Row3<double>& row = a.rows.joint[k];
      if (const int dof = shared_dof_[flat(link)]; dof >= 0) {
        y[touched] = row;
        index_[touched++] = dof;
        continue;
      }
      double z[3];
      store(row, z);
      for (int r = 0; r < 3; ++r) own[r] = madd(row, z[r], own[r]);
      if (with_x) offset = madd(row, x_of(link), offset);
    }
    double columns[3][3], *p = problem_.private_block(c);
    for (int r = 0; r < 3; ++r) store(own[r], columns[r]);
    p[0] = columns[0][0], p[1] = columns[0][1], p[2] = columns[0][2];
    p[3] = columns[1][1], p[4] = columns[1][2], p[5] = columns[2][2];
    if (num_shared > 0 || !floating_) problem_.set_index(c, index_.data(), touched);
    store(offset, problem_.offset(c));
    problem_.friction(c) = laws_[a.shape].friction;
  }
  for (int i = 0; i < count_; ++i)
    for (int k = 0; k < active_[i].rows.depth; ++k) {
      uses_[flat(active_[i].rows.path[k])] = 0;
      shared_dof_[flat(active_[i].rows.path[k])] = -1;
    }
}

void ContactStage::solve(const StepSolverOptions& options, double* warm, double h, StepInfo& info) {
  for (int i = 0; i < count_; ++i)
    for (int r = 0; r < 3; ++r)
      problem_.impulse(i)[r] = options.warm_start ? warm[3 * active_[i].id + r] * h : 0;
  if (options.method == SolveMethod::kAuto) {
    contact::FactoredOptions o = contact::default_options<double>();
    o.max_dissipation = options.law == FrictionLaw::kMaxDissipation;
    o.tolerance_absolute = options.tolerance;
    o.tolerance_relative = options.relative_tolerance;
    const contact::FactoredInfo<double> found = contact::solve_factored(problem_, o);
    info.sweeps = found.sweeps;
    info.newton_steps = found.newton_steps + found.fallback_steps;
    info.residual = found.residual;
    const bool chain = !o.max_dissipation && std::isfinite(found.residual);
    if (!found.converged && !(chain && solve_by_chain(o.residual_tolerance, info)))
      info.status = StepStatus::kNotConverged;
  } else {
    solve_explicit(options, info);
  }
  info.contacts = count_;
  std::fill(warm, warm + 3 * num_points_, 0.0);
  for (int i = 0; i < count_; ++i)
    for (int r = 0; r < 3; ++r) warm[3 * active_[i].id + r] = problem_.impulse(i)[r] / h;
}

void ContactStage::add_impulses(Tree<double>& tree) const {
  const int base_dofs = floating_ ? 6 : 0;
  for (int k = 0; k < base_dofs; ++k) tree.base.x[k] += problem_.w[k] - problem_.w0[k];
  for (int k = 0; k < num_shared_; ++k) {
    const LinkIndex link = shared_[k];
    auto& x = tree.links[link.slot].x;
    set_lane(x, link.lane,
             get_lane(x, link.lane) + (problem_.w[base_dofs + k] - problem_.w0[base_dofs + k]));
  }
  for (int i = 0; i < count_; ++i) {
    const double* l = problem_.contact(i).impulse;
    for (int k = 0; k < active_[i].rows.depth; ++k) {
      const LinkIndex link = active_[i].rows.path[k];
      bool shared = false;
      for (int s = 0; s < num_shared_ && !shared; ++s)
        shared = shared_[s].slot == link.slot && shared_[s].lane == link.lane;
      if (shared) continue;
      double z[3];
      store(active_[i].rows.joint[k], z);
      auto& x = tree.links[link.slot].x;
      set_lane(x, link.lane,
               madd(z[2], l[2], madd(z[1], l[1], madd(z[0], l[0], get_lane(x, link.lane)))));
    }
  }
}

bool ContactStage::any_impulse() const {
  for (int i = 0; i < count_; ++i)
    if (problem_.contact(i).impulse[2] > 0) return true;
  return false;
}

double ContactStage::work_rate_of_gravity() const {
  double sum = 0;
  for (int i = 0; i < count_; ++i) {
    const double* l = problem_.contact(i).impulse;
    sum += dot(Vec3<double>{l[0], l[1], l[2]}, active_[i].gravity);
  }
  return sum;
}

double ContactStage::work() const {
  double sum = 0;
  for (int i = 0; i < count_; ++i) {
    const double* l = problem_.contact(i).impulse;
    const Vec3<double> after = velocity_after(i), &before = active_[i].velocity;
    sum += 0.5 * (l[0] * (before.x + after.x) + l[1] * (before.y + after.y) +
                  l[2] * (before.z + after.z));
  }
  return sum;
}

// ---- the same problem, dense

ContactProblem ContactStage::explicit_problem() const {
  ContactProblem p;
  if (count_ == 0) return p;  // the factored problem may be an older step's
  const size_t n = count_;
  p.delassus.resize(9 * n * n);
  p.free_velocity.resize(3 * n);
  p.friction.resize(n);
  std::vector<double> lambda(3 * n);
  contact::write_out(problem_, p.delassus.data(), p.free_velocity.data(), p.friction.data(),
                     lambda.data());
  return p;
}

size_t ContactStage::dense_size(int contacts) {
  const size_t n = contacts;
  return 9 * n * n + 7 * n + contact::ExplicitProblem::workspace_size(contacts);
}

contact::ExplicitProblem ContactStage::dense_problem(double* memory) const {
  const size_t n = count_;
  double *g = memory, *c = g + 9 * n * n, *mu = c + 3 * n, *lambda = mu + n;
  contact::write_out(problem_, g, c, mu, lambda);
  contact::ExplicitProblem p{count_, g, c, mu, lambda};
  p.attach(lambda + 3 * n);
  contact::prepare(p);
  return p;
}

void ContactStage::solve_explicit(const StepSolverOptions& options, StepInfo& info) {
  contact::ExplicitProblem p = dense_problem(dense_.data());
  contact::SweepOptions o;
  o.max_dissipation = options.law == FrictionLaw::kMaxDissipation;
  o.method = contact::method_of(options.single_contact);
  o.stop = options.method == SolveMethod::kPgs ? contact::StopTest::kUpdateSum
                                               : contact::StopTest::kViolationSum;
  o.tolerance = options.tolerance;
  o.max_sweeps = options.max_sweeps;
  o.alpha = options.alpha, o.alpha_min = options.alpha_min, o.gamma = options.gamma;
  const contact::SweepResult found =
      options.method == SolveMethod::kPgs ? contact::pgs(p, o) : contact::per_contact(p, o);
  contact::refresh_velocity(p);
  info.sweeps = found.sweeps;
  info.newton_steps = 0;
  info.residual = contact::largest_residual(p, o.max_dissipation);
  if (!found.converged) info.status = StepStatus::kNotConverged;
  contact::read_back(problem_, p.lambda, p.v);
}

bool ContactStage::solve_by_chain(double tolerance, StepInfo& info) {
  if (count_ > solvers::kRobotSized) return false;
  std::pmr::monotonic_buffer_resource memory(chain_memory_.get(), chain_bytes(count_));
  solvers::Doubles numbers(dense_size(count_), &memory);
  contact::ExplicitProblem p = dense_problem(numbers.data());
  solvers::BestImpulse best(tolerance, false, nullptr, &memory);
  solvers::Effort effort;
  if (!best.offer(p, SolveStage::kStart)) solvers::run_brief_chain(p, best, effort, &memory);
  info.newton_steps += effort.newton_steps + effort.interior_point_steps;
  best.restore(p);
  // Contacts that cannot push count here: a step may not hide that one is driven in.
  const double residual = largest_residual(p, false);
  if (!(residual <= tolerance)) return false;
  info.residual = residual;
  contact::read_back(problem_, p.lambda, p.v);
  return true;
}

bool ContactStage::correct_overlap(Tree<double>& tree, double clearance, double tolerance) {
  overlap_.clear();
  for (int i = 0; i < count_; ++i) {
    const int s = active_[i].shape;
    if (i == 0 || s != active_[i - 1].shape) placed_[s] = collide::place(tree, shapes_[s]);
    const Vec3<double> p = collide::support_point(shapes_[s], placed_[s], active_[i].point);
    overlap_.add(shapes_[s].link, p, p.z + clearance);
  }
  return overlap_.run(tree, tolerance);
}

}  // namespace stickslip::step
