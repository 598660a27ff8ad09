#include "step/contact_stage.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>

#include "contact/per_contact.h"
#include "contact/pgs.h"

namespace stickslip::step {
namespace {

using dynamics::kBaseSlot;
using dynamics::kMaxLanes;
using dynamics::LinkIndex;
using dynamics::Tree;

constexpr int kCorrectionSweeps = 50;
constexpr double kReach = 2e-3;  // candidates this near take part whatever their speed [m]

int flat(LinkIndex link) { return link.slot * kMaxLanes + link.lane; }

char* aligned_block(long bytes) {
  return static_cast<char*>(::operator new(static_cast<size_t>(bytes), std::align_val_t(64)));
}
void free_block(char* block) { ::operator delete(block, std::align_val_t(64)); }

Mat3<double> ground_frame() {
  return {{1, 0, 0, 0, 1, 0, 0, 0, 1}};
}  // x, y along the world's, z up

}  // namespace

ContactStage::ContactStage(const Model& model, const dynamics::TreeLayout& layout, int max_depth)
    : shapes_(collide::ground_shapes(model, layout)),
      placed_(shapes_.size()),
      laws_(shapes_.size()),
      num_points_(collide::total_points(shapes_)),
      max_depth_(max_depth),
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
      moved_(num_points_),
      gaps_(num_points_ + 3),
      displacement_(num_dofs_),
      normal_(static_cast<size_t>(num_points_ + 3) * num_dofs_),
      gram_(static_cast<size_t>(num_points_ + 3) * num_points_),
      pushes_(num_points_ + 3) {
  const contact::FactoredCapacity capacity{std::max(num_points_, 1), num_dofs_};
  memory_.reset(aligned_block(contact::FactoredProblem<double>::required_bytes(capacity)));
  problem_.attach(memory_.get(), capacity);
  for (int i = 0; i < num_points_; ++i) {
    active_[i].rows.path = paths_.data() + static_cast<size_t>(i) * max_depth;
    active_[i].rows.joint = rows_.data() + static_cast<size_t>(i) * max_depth;
  }
}

void ContactStage::reserve_explicit() {
  const size_t n = num_points_;
  dense_.resize(9 * n * n + 7 * n + contact::ExplicitProblem::workspace_size(num_points_));
}

// ---- which points take part

void ContactStage::add(int shape, int point, const Vec3<double>& position, double gap) {
  ActiveContact& a = active_[count_++];
  a.shape = shape;
  a.point = point;
  a.id = shapes_[shape].first_point + point;
  a.position = position;
  a.gap = gap;
  a.shift = 0;
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

void ContactStage::allow_closing(double h) {
  for (int i = 0; i < count_; ++i)
    if (active_[i].gap > 0) active_[i].shift = active_[i].gap / h;
}

void ContactStage::add_restitution(double kick, double h) {
  for (int i = 0; i < count_; ++i) {
    ActiveContact& a = active_[i];
    const MaterialPair& law = laws_[a.shape];
    const double before = a.velocity.z - kick;
    if (law.restitution > 0 && -before > law.restitution_threshold && a.gap + h * a.velocity.z < 0)
      a.shift = law.restitution * before;
  }
}

// ---- the factored problem

void ContactStage::build_problem(Tree<double>& tree, bool with_x) {
  const Mat3<double> frame = ground_frame();
  for (int i = 0; i < count_; ++i) {
    ActiveContact& a = active_[i];
    dynamics::compute_contact_rows(tree, shapes_[a.shape].link, a.position, frame, a.rows);
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
    double* p = problem_.private_block(c);
    for (int k = a.rows.depth - 1; k >= 0; --k) {
      const LinkIndex link = a.rows.path[k];
      if (const int dof = shared_dof_[flat(link)]; dof >= 0) {
        y[touched] = a.rows.joint[k];
        index_[touched++] = dof;
        continue;
      }
      double z[3];
      store(a.rows.joint[k], z);
      p[0] = madd(z[0], z[0], p[0]), p[1] = madd(z[0], z[1], p[1]), p[2] = madd(z[0], z[2], p[2]);
      p[3] = madd(z[1], z[1], p[3]), p[4] = madd(z[1], z[2], p[4]), p[5] = madd(z[2], z[2], p[5]);
      if (with_x) offset = madd(a.rows.joint[k], x_of(link), offset);
    }
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
    if (!found.converged) info.status = StepStatus::kNotConverged;
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

Vec3<double> ContactStage::total_impulse() const {
  Vec3<double> sum = zero3<double>();
  for (int i = 0; i < count_; ++i) {
    const double* l = problem_.contact(i).impulse;
    sum = sum + Vec3<double>{l[0], l[1], l[2]};
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

// ---- the same problem written out

void ContactStage::write_out(double* g, double* c, double* mu, double* lambda) const {
  const int n = count_, m = 3 * n;
  for (int i = 0; i < n; ++i) {
    const contact::FactoredContact<double>& a = problem_.contact(i);
    const int na = problem_.six() ? 6 : a.count;
    const auto dof = [&](const contact::FactoredContact<double>& k, int j) {
      return problem_.six() ? j : k.index[j];
    };
    for (int j = 0; j <= i; ++j) {
      const contact::FactoredContact<double>& b = problem_.contact(j);
      const int nb = problem_.six() ? 6 : b.count;
      Row3<double> block[3];  // columns of G_ij: rows of a, one per row of b
      for (auto& column : block) column = make_row3(0.0, 0.0, 0.0);
      for (int ka = 0, kb = 0; ka < na && kb < nb;) {
        if (dof(a, ka) != dof(b, kb)) {
          dof(a, ka) < dof(b, kb) ? ++ka : ++kb;
          continue;
        }
        double row[3];
        store(b.y[kb++], row);
        for (int r = 0; r < 3; ++r) block[r] = madd(a.y[ka], row[r], block[r]);
        ++ka;
      }
      double entries[3][3];
      for (int r = 0; r < 3; ++r) store(block[r], entries[r]);
      if (i == j) {
        const double* p = a.private_block;
        const double full[3][3] = {{p[0], p[1], p[2]}, {p[1], p[3], p[4]}, {p[2], p[4], p[5]}};
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s) entries[r][s] += full[r][s];
      }
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s)
          g[(3 * i + s) * m + 3 * j + r] = g[(3 * j + r) * m + 3 * i + s] = entries[r][s];
    }
    Row3<double> free = make_row3(a.offset[0], a.offset[1], a.offset[2]);
    for (int k = 0; k < na; ++k) free = madd(a.y[k], problem_.w0[dof(a, k)], free);
    store(free, c + 3 * i);
    mu[i] = a.friction;
    for (int r = 0; r < 3; ++r) lambda[3 * i + r] = a.impulse[r];
  }
}

ContactProblem ContactStage::explicit_problem() const {
  ContactProblem p;
  const size_t n = count_;
  p.delassus.resize(9 * n * n);
  p.free_velocity.resize(3 * n);
  p.friction.resize(n);
  std::vector<double> lambda(3 * n);
  write_out(p.delassus.data(), p.free_velocity.data(), p.friction.data(), lambda.data());
  return p;
}

void ContactStage::solve_explicit(const StepSolverOptions& options, StepInfo& info) {
  const size_t n = count_;
  double *g = dense_.data(), *c = g + 9 * n * n, *mu = c + 3 * n, *lambda = mu + n;
  write_out(g, c, mu, lambda);
  contact::ExplicitProblem p{count_, g, c, mu, lambda, nullptr, nullptr};
  p.attach(lambda + 3 * n);
  contact::prepare(p);
  contact::SweepOptions o;
  o.max_dissipation = options.law == FrictionLaw::kMaxDissipation;
  o.method = static_cast<contact::Method>(options.single_contact);
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
  for (int k = 0; k < problem_.dofs(); ++k) problem_.w[k] = problem_.w0[k];
  for (int i = 0; i < count_; ++i) {
    contact::FactoredContact<double>& a = problem_.contact(i);
    for (int r = 0; r < 3; ++r) a.impulse[r] = lambda[3 * i + r], a.velocity[r] = p.v[3 * i + r];
    const bool six = problem_.six();
    for (int k = 0; k < (six ? 6 : a.count); ++k) {
      double y[3], &w = problem_.w[six ? k : a.index[k]];
      store(a.y[k], y);
      for (int r = 0; r < 3; ++r) w = madd(y[r], a.impulse[r], w);
    }
  }
}

// ---- overlap

bool ContactStage::correct_overlap(Tree<double>& tree, double clearance, double tolerance) {
  bool overlap = false;
  for (int i = 0; i < count_; ++i) {
    ActiveContact& a = active_[i];
    placed_[a.shape] = collide::place(tree, shapes_[a.shape]);
    moved_[i] = collide::support_point(shapes_[a.shape], placed_[a.shape], a.point);
    gaps_[i] = moved_[i].z + clearance;
    overlap = overlap || gaps_[i] < -tolerance;
  }
  if (!overlap) return false;
  // Normal rows, dof by dof: entry (k, i) at k * stride + i, so that everything below runs over
  // contacts.
  const int m = num_dofs_, stride = (count_ + 3) / 4 * 4;
  double *z = normal_.data(), *x = pushes_.data(), *r = gaps_.data(), *gram = gram_.data();
  std::fill(z, z + static_cast<size_t>(m) * stride, 0.0);
  for (int i = 0; i < count_; ++i) {
    double base[6];
    dynamics::compute_row(tree, shapes_[active_[i].shape].link, moved_[i], {0.0, 0.0, 1.0}, base,
                          [&](LinkIndex link, double entry) {
                            z[(6 + tree.slots[link.slot].joint[link.lane]) * stride + i] = entry;
                          });
    if (floating_)
      for (int k = 0; k < 6; ++k) z[k * stride + i] = base[k];
  }
  for (int j = 0; j < count_; ++j) {  // columns of Z Z^T
    double* column = gram + static_cast<size_t>(j) * stride;
    std::fill(column, column + stride, 0.0);
    for (int k = 0; k < m; ++k) {
      const double* row = z + static_cast<size_t>(k) * stride;
      if (row[j] == 0) continue;
      for (int i = 0; i < stride; ++i) column[i] = madd(row[i], row[j], column[i]);
    }
  }
  // Projected Gauss-Seidel; r = gap + Z Z^T x is kept.
  std::fill(x, x + count_, 0.0);
  for (int i = count_; i < stride; ++i) r[i] = 0;
  for (int sweep = 0; sweep < kCorrectionSweeps; ++sweep) {
    double change = 0;
    for (int i = 0; i < count_; ++i) {
      const double* column = gram + static_cast<size_t>(i) * stride;
      if (!(column[i] > 0)) continue;
      const double next = std::max(0.0, x[i] - r[i] / column[i]), step = next - x[i];
      x[i] = next;
      for (int j = 0; j < stride; ++j) r[j] = madd(column[j], step, r[j]);
      change = std::max(change, std::fabs(step) * column[i]);
    }
    if (change < 0.1 * tolerance) break;
  }
  std::vector<double>& d = displacement_;
  for (int k = 0; k < m; ++k) {
    d[k] = 0;
    for (int i = 0; i < count_; ++i)
      d[k] = madd(z[static_cast<size_t>(k) * stride + i], x[i], d[k]);
  }
  for (int k = 0; k < 6; ++k) tree.base.x[k] = d[k];
  for (int slot = 0; slot < tree.num_slots; ++slot)
    for (int lane = 0; lane < kMaxLanes; ++lane)
      set_lane(tree.links[slot].x, lane, d[6 + tree.slots[slot].joint[lane]]);
  return true;
}

}  // namespace stickslip::step
