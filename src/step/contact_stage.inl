// Bodies of contact_stage.h.
#pragma once
#include "step/lane_arrays.h"
#include "step/robot_lanes.h"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template <class S>
void ContactStage<S>::lay_out(contact::Arena& arena, const RobotTables& tables) {
  tables_ = &tables;
  const int points = tables.num_points, dofs = tables.num_joints + 6;
  active_ = arena.take<ActiveContact<S>>(points);
  once_ = arena.take<Mask<S>>(links());
  shared_ = arena.take<Mask<S>>(links());
  common_ = arena.take<Mask<S>>(links());
  dof_ = arena.take<int>(links());
  link_of_dof_ = arena.take<dynamics::LinkIndex>(tables.num_joints);
  index_ = arena.take<int>(dofs);
  odd_ = arena.take<bool>(dofs);
  for (int k = 0; odd_ && k < 6; ++k) odd_[k] = k & 1;
  const auto lay_out_rows = [&](dynamics::ContactRows<S>* rows) {
    auto* path = arena.take<dynamics::LinkIndex>(tables.max_depth);
    auto* joint = arena.take<Row3<S>>(tables.max_depth);
    if (rows) rows->path = path, rows->joint = joint;
  };
  for (int i = 0; i < points; ++i) lay_out_rows(active_ ? &active_[i].rows : nullptr);
  touching_ = arena.take<TouchingLink<S>>(tables.num_touching);
  for (int i = 0; i < tables.num_touching; ++i) {
    for (int k = 0; k < 2; ++k) {
      auto* rows = !touching_ ? nullptr : k == 0 ? &touching_[i].linear : &touching_[i].angular;
      lay_out_rows(rows);
      auto* base = arena.take<Row3<S>>(6);
      if (rows) rows->base = base;
    }
  }
  const contact::FactoredCapacity capacity{points > 0 ? points : 1, dofs, tables.num_touching};
  char* block = arena.take<char>(contact::FactoredProblem<S>::required_bytes(capacity));
  if (block) problem_.attach(block, capacity);
  overlap_.lay_out(arena, points, dofs);
  const long dense = points;
  dense_ = arena.take<double>(9 * dense * dense + 10 * dense);
  count_ = 0;
}

template <class S>
void ContactStage<S>::forget(Mask<S> lanes) {
  bool some = false;
  for (int i = 0; i < count_; ++i) {
    active_[i].active = active_[i].active & !lanes;
    some = some || any(active_[i].active);
  }
  if (!some) count_ = 0;
}

// ---- which points take part

template <class S>
void ContactStage<S>::add(int shape, int point, const Vec3<S>& position, S gap, Mask<S> active) {
  ActiveContact<S>& a = active_[count_++];
  a.shape = shape;
  a.point = point;
  a.id = tables_->shapes[shape].first_point + point;
  a.active = active;
  a.position = position;
  a.gap = gap;
  a.shift = constant<S>(0);
  a.gravity = zero3<S>();
}

template <class S>
void ContactStage<S>::detect_within(const dynamics::Tree<S>& tree, S clearance, S reach,
                                    Mask<S> live) {
  count_ = 0;
  for (int k = 0; k < tables_->num_shapes; ++k) {
    const int s = tables_->by_body[k];
    const collide::GroundShape& shape = tables_->shapes[s];
    const Mask<S> near = live & (collide::lowest_point(tree, shape) + clearance < reach);
    if (!any(near)) continue;
    const collide::PlacedShape<S> placed = collide::place(tree, shape);
    for (int i = 0; i < shape.num_points; ++i) {
      const Vec3<S> p = collide::support_point(shape, placed, i);
      const S gap = p.z + clearance;
      const Mask<S> active = near & (gap < reach);
      if (any(active)) add(s, i, p, gap, active);
    }
  }
}

/// The fastest point of any shape may not outrun the list: impulses couple the links.
template <class S>
S ContactStage<S>::fastest_shape(const dynamics::Tree<S>& tree,
                                 const Vec3<S>& base_velocity) const {
  S fastest = constant<S>(0);
  for (int k = 0; k < tables_->num_shapes; ++k) {
    const collide::GroundShape& s = tables_->shapes[k];
    const Spatial<S> v = s.link.slot == dynamics::kBaseSlot
                             ? tree.base.velocity
                             : dynamics::field_of<S, Spatial>(
                                   tree, s.link, &dynamics::LinkState<dynamics::Wide<S>>::velocity);
    const Vec3<S> at_center = cross(v.ang, collide::shape_center(tree, s), v.lin + base_velocity);
    const S turning = sqrt(dot(v.ang, v.ang)) * constant<S>(s.bounding_radius);
    fastest = max(fastest, sqrt(dot(at_center, at_center)) + turning);
  }
  return fastest;
}

template <class S>
void ContactStage<S>::detect_reachable(const dynamics::Tree<S>& tree, S clearance,
                                       const Vec3<S>& base_velocity, S h, Mask<S> live) {
  const S zero = constant<S>(0), reach = constant<S>(kReach);
  const S fastest = fastest_shape(tree, base_velocity);
  detect_within(tree, clearance, reach + constant<S>(2) * h * fastest, live);
  // The rows are those of the points on the plane below: a gap then closes without a tangential
  // velocity of its own, and the allowed approach of coplanar points is one rigid motion.
  for (int i = 0; i < count_; ++i) active_[i].position.z = -clearance;
  compute_velocities(tree, base_velocity);
  int kept = 0;
  for (int i = 0; i < count_; ++i) {
    const ActiveContact<S>& a = active_[i];
    const Mask<S> active = a.active & (a.gap < reach + h * (max(zero, -a.velocity.z) + fastest));
    if (!any(active)) continue;
    if (kept != i) {
      const dynamics::ContactRows<S> rows = active_[kept].rows;  // memory stays with its place
      active_[kept] = a;
      active_[kept].rows = rows;
    }
    active_[kept++].active = active;
  }
  count_ = kept;
}

template <class S>
void ContactStage<S>::compute_velocities(const dynamics::Tree<S>& tree,
                                         const Vec3<S>& base_velocity) {
  for (int i = 0; i < count_; ++i) {
    const dynamics::LinkIndex link = tables_->shapes[active_[i].shape].link;
    active_[i].velocity = dynamics::point_velocity(tree, link, active_[i].position) + base_velocity;
  }
}

template <class S>
void ContactStage<S>::allow_closing(S h, double tolerance) {
  // Within the tolerance an overlap counts like a gap. Clamped at zero, the gaps of coplanar points
  // would no longer be those of one rigid motion, and the problem would be nearly contradictory.
  for (int i = 0; i < count_; ++i)
    active_[i].shift = max(active_[i].gap, constant<S>(-tolerance)) / h;
}

template <class S>
void ContactStage<S>::set_gravity(const Vec3<S>& gravity) {
  for (int i = 0; i < count_; ++i) active_[i].gravity = gravity;
}

template <class S>
void ContactStage<S>::take_gravity(const dynamics::Tree<S>& tree) {
  for (int i = 0; i < count_; ++i)
    active_[i].gravity =
        dynamics::point_velocity(tree, tables_->shapes[active_[i].shape].link, active_[i].position);
}

template <class S>
void ContactStage<S>::add_restitution(S fall, S h) {
  const S zero = constant<S>(0);
  for (int i = 0; i < count_; ++i) {
    ActiveContact<S>& a = active_[i];
    const double e = tables_->restitution[a.shape];
    if (!(e > 0)) continue;
    const S kick = fall * a.gravity.z, before = a.velocity.z - kick;
    const auto bounces = (-before > constant<S>(tables_->restitution_threshold[a.shape])) &
                         (a.gap + h * a.velocity.z < zero);
    // The rebound is kicked like any motion: with e = 1 a ball keeps its energy. Not into the
    // ground.
    a.shift = select(bounces, min(constant<S>(e) * before - kick, max(zero, a.gap) / h), a.shift);
  }
}

// ---- its solve

/// The factored solver's options for the precision of S: never finer than it can reach.
template <class S>
contact::FactoredOptions solver_options(const StepSettings& settings) {
  contact::FactoredOptions o = contact::default_options<S>();
  const bool single = sizeof(Value<S>) == 4;
  const auto at_least = [&](double floor, double x) { return single && x < floor ? floor : x; };
  o.max_dissipation = settings.max_dissipation;
  // Below the defaults the certificate would not notice a sweep that is missing.
  o.foresee = o.foresee && settings.tolerance >= o.tolerance_absolute &&
              settings.relative_tolerance >= o.tolerance_relative;
  o.tolerance_absolute = at_least(o.tolerance_absolute, settings.tolerance);
  o.tolerance_relative = at_least(o.tolerance_relative, settings.relative_tolerance);
  return o;
}

template <class S>
void ContactStage<S>::start_at(const S* last, const S* earlier, S h) {
  const S zero = constant<S>(0);
  for (int i = 0; i < count_; ++i) {
    const int at = 3 * active_[i].id;
    S* impulse = problem_.impulse(i);
    for (int r = 0; r < 3; ++r) impulse[r] = last ? last[at + r] : zero;
    if (last && earlier) {
      const S part = constant<S>(tables_->foresight[active_[i].shape]);
      const Mask<S> pushed = (last[at + 2] > zero) & (earlier[at + 2] > zero);
      for (int r = 0; r < 3; ++r)
        impulse[r] =
            select(pushed, madd(part, impulse[r] - earlier[at + r], impulse[r]), impulse[r]);
    }
    for (int r = 0; r < 3; ++r) impulse[r] = impulse[r] * h;
  }
}

template <class S>
void ContactStage<S>::solve(const StepSettings& settings, Mask<S> live, LaneInfo<S>& info) {
  const S zero = constant<S>(0);
  for (int i = 0; i < count_; ++i) problem_.active(i) = active_[i].active & live;
  if (settings.host.always) {
    solve_by_method(settings.host, info);
  } else {
    const contact::FactoredOptions o = solver_options<S>(settings);
    const contact::FactoredInfo<S> found = contact::solve_factored(problem_, o);
    info.sweeps = found.sweeps;
    info.newton_steps = found.newton_steps + found.fallback_steps;
    info.residual = select(live, reported_residual(found.residual), info.residual);
    info.unconverged = live & !found.converged;
    const Mask<S> open = info.unconverged & is_finite(found.residual);
    if (any(open) && settings.host.solve && !o.max_dissipation)
      solve_by_chain(settings.host, open, o.residual_tolerance, info);
  }
  info.contacts = count_;
  for (int i = 0; i < count_; ++i)  // a zero is +0, whichever way it came about
    for (int r = 0; r < 3; ++r) problem_.impulse(i)[r] = problem_.impulse(i)[r] + zero;
}

template <class S>
void ContactStage<S>::write_forces(Mask<S> live, S h, S* forces) const {
  const S inverse = constant<S>(1) / h;
  clear_where(live, 3 * tables_->num_points, forces);
  for (int i = 0; i < count_; ++i) {
    const Mask<S> here = live & active_[i].active;
    for (int r = 0; r < 3; ++r) {
      S& force = forces[3 * active_[i].id + r];
      force = select(here, impulse(i)[r] * inverse, force);
    }
  }
}

template <class S>
void ContactStage<S>::add_impulses(dynamics::Tree<S>& tree, Mask<S> lanes) const {
  const int base_dofs = tables_->floating ? 6 : 0;
  const S zero = constant<S>(0);
  const auto change = [&](int k) { return select(lanes, problem_.w[k] - problem_.w0[k], zero); };
  const auto x_of = [&](dynamics::LinkIndex link) {
    return dynamics::lane_of<S>(tree.links[link.slot].x, link.lane);
  };
  for (int k = 0; k < base_dofs; ++k) tree.base.x[k] = tree.base.x[k] + change(k);
  for (int k = 0; k < num_shared_; ++k) {
    const dynamics::LinkIndex link = link_of_dof_[k];
    dynamics::put_lane<S>(tree.links[link.slot].x, link.lane, x_of(link) + change(base_dofs + k));
  }
  for (int i = 0; i < count_; ++i) {
    const S* impulse = problem_.contact(i).impulse;
    S l[3];
    for (int r = 0; r < 3; ++r) l[r] = select(lanes & active_[i].active, impulse[r], zero);
    for (int k = 0; k < active_[i].rows.depth; ++k) {
      const dynamics::LinkIndex link = active_[i].rows.path[k];
      Row3<S> row = active_[i].rows.joint[k];
      if (shared_dof(link) >= 0) {
        if (!any(active_[i].active & !shared_[flat(link)])) continue;
        row = row_where(!shared_[flat(link)], row);
      }
      S z[3];
      store(row, z);
      dynamics::put_lane<S>(tree.links[link.slot].x, link.lane,
                            madd(z[2], l[2], madd(z[1], l[1], madd(z[0], l[0], x_of(link)))));
    }
  }
}

template <class S>
Mask<S> ContactStage<S>::any_impulse() const {
  Mask<S> pushes = none<S>();
  for (int i = 0; i < count_; ++i)
    pushes = pushes | (active_[i].active & (problem_.contact(i).impulse[2] > constant<S>(0)));
  return pushes;
}

template <class S>
S ContactStage<S>::work_rate_of_gravity() const {
  S sum = constant<S>(0);
  for (int i = 0; i < count_; ++i) {
    const S* l = problem_.contact(i).impulse;
    sum = sum + dot(Vec3<S>{l[0], l[1], l[2]}, active_[i].gravity);
  }
  return sum;
}

template <class S>
S ContactStage<S>::work() const {
  S sum = constant<S>(0);
  for (int i = 0; i < count_; ++i) {
    const S* l = problem_.contact(i).impulse;
    const Vec3<S> after = velocity_after(i), &before = active_[i].velocity;
    const S twice =
        l[0] * (before.x + after.x) + l[1] * (before.y + after.y) + l[2] * (before.z + after.z);
    sum = sum + select(active_[i].active, constant<S>(0.5) * twice, constant<S>(0));
  }
  return sum;
}

// ---- solved on the host

/// Views a problem of n contacts in `memory`.
inline DenseProblem dense_problem(int n, double* memory) {
  DenseProblem d{n, memory, memory + 9 * n * n, nullptr, nullptr, nullptr};
  d.friction = d.free_velocity + 3 * n;
  d.impulse = d.friction + n;
  d.velocity = d.impulse + 3 * n;
  return d;
}

template <class S>
HostSolver::Effort ContactStage<S>::ask_host(const HostSolver& host,
                                             contact::FactoredProblem<double>& p,
                                             double tolerance) {
  DenseProblem d = dense_problem(p.size(), dense_);
  contact::write_out(p, d.delassus, d.free_velocity, d.friction, d.impulse);
  const HostSolver::Effort effort = host.solve(host.self, d, tolerance);
  if (!effort.solved && !host.always) return effort;
  contact::read_back(p, d.impulse, d.velocity);
  return effort;
}

/// The paper's methods, in place of the factored solver: worlds only.
template <class S>
void ContactStage<S>::solve_by_method(const HostSolver& host, LaneInfo<S>& info) {
  if constexpr (ScalarTraits<S>::kWidth == 1 && sizeof(S) == 8) {
    const HostSolver::Effort effort = ask_host(host, problem_, 0);
    info.sweeps = effort.sweeps;
    info.newton_steps = 0;
    info.residual = reported_residual(effort.residual);
    info.unconverged = !effort.solved;
  }
}

/// The first stages of the chain of `stickslip::solve`, lane by lane in double, where the factored
/// solver ended above its tolerance.
template <class S>
void ContactStage<S>::solve_by_chain(const HostSolver& host, Mask<S> lanes, double tolerance,
                                     LaneInfo<S>& info) {
  const S zero = constant<S>(0);
  S solved = zero;
  contact::solve_lanes(problem_, lanes, [&](contact::FactoredProblem<double>& p, int lane) {
    if (p.size() > host.max_contacts) return;
    const HostSolver::Effort effort = ask_host(host, p, tolerance);
    info.newton_steps += effort.newton_steps;
    if (effort.solved) set_lane(solved, lane, Value<S>(1));
  });
  const S residual = contact::certify_impulses(problem_);
  info.residual = select(lanes, residual, info.residual);
  info.unconverged =
      info.unconverged & !(lanes & (solved > zero) & (residual <= constant<S>(tolerance)));
}

template <class S>
Mask<S> ContactStage<S>::correct_overlap(dynamics::Tree<S>& tree, S clearance, double tolerance) {
  overlap_.clear();
  collide::PlacedShape<S> placed;
  for (int i = 0; i < count_; ++i) {
    const int s = active_[i].shape;
    const collide::GroundShape& shape = tables_->shapes[s];
    if (i == 0 || s != active_[i - 1].shape) placed = collide::place(tree, shape);
    const Vec3<S> p = collide::support_point(shape, placed, active_[i].point);
    overlap_.add(shape.link, p, p.z + clearance, active_[i].active);
  }
  return overlap_.run(tree, constant<S>(tolerance));
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
