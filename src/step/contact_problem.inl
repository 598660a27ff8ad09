// Bodies of contact_stage.h that make the factored problem: rows, links that touch with several
// points, joints that contacts share.
#pragma once
#include "step/contact_stage.inl"

namespace stickslip::step::inline STICKSLIP_KERNELS {

template <class S>
Occupied<S> ContactStage<S>::occupied(int first, int end) const {
  Occupied<S> lanes = {none<S>(), none<S>()};
  for (int i = first; i < end; ++i) {
    lanes.twice = lanes.twice | (lanes.once & active_[i].active);
    lanes.once = lanes.once | active_[i].active;
  }
  return lanes;
}

template <class S>
const TouchingLink<S>* ContactStage<S>::add_link(const dynamics::Tree<S>& tree, int first,
                                                 int end) {
  using State = dynamics::LinkState<dynamics::Wide<S>>;
  const dynamics::LinkIndex link = tables_->shapes[active_[first].shape].link;
  // Body 0 has no joints of its own, and little to gain.
  if (end - first < 2 || link.slot == dynamics::kBaseSlot) return nullptr;
  const Mask<S> several = occupied(first, end).twice;
  if (!any(several)) return nullptr;
  TouchingLink<S>& t = touching_[num_touching_++];
  t.first = first, t.end = end, t.several = several;
  t.origin = dynamics::field_of<S, Vec3>(tree, link, &State::position);
  dynamics::compute_contact_rows(tree, link, t.origin, t.linear);
  dynamics::compute_angular_rows(tree, link, t.angular);
  return &t;
}

/// In lanes where a link has several contacts, their rows are made from those of the link.
template <class S>
void ContactStage<S>::compute_rows(const dynamics::Tree<S>& tree) {
  num_touching_ = 0;
  for (int first = 0, end; first < count_; first = end) {
    end = next_link(first);
    const TouchingLink<S>* t = add_link(tree, first, end);
    for (int i = first; i < end; ++i) {
      ActiveContact<S>& a = active_[i];
      a.rows.base = problem_.y(i);  // where the problem wants them
      const bool single = !t || any(a.active & !t->several);
      if (single)
        dynamics::compute_contact_rows(tree, tables_->shapes[a.shape].link, a.position, a.rows);
      if (!t) continue;
      const Vec3<S> arm = a.position - t->origin;
      const auto put = [&](const Row3<S>& linear, const Row3<S>& angular, Row3<S>& to)
                           STICKSLIP_LAMBDA {
                             const Row3<S> row = dynamics::at_point(linear, angular, arm);
                             store(single ? select(t->several, row, to) : row, to);
                           };
      a.rows.depth = t->linear.depth;
      for (int k = 0; k < a.rows.depth; ++k) {
        a.rows.path[k] = t->linear.path[k];
        put(t->linear.joint[k], t->angular.joint[k], a.rows.joint[k]);
      }
      for (int k = 0; k < 6; ++k) put(t->linear.base[k], t->angular.base[k], a.rows.base[k]);
    }
  }
}

template <class S>
bool ContactStage<S>::apart() const {
  for (int i = 0; i < count_; ++i)
    if (!tables_->apart[active_[i].shape]) return false;
  return true;
}

template <class S>
int ContactStage<S>::next_link(int i) const {
  const auto body = [&](int k) { return tables_->shapes[active_[k].shape].body; };
  int end = i + 1;
  while (end < count_ && body(end) == body(i)) ++end;
  return end;
}

template <class S>
void ContactStage<S>::find_shared_joints() {
  for (int k = 0; k < links(); ++k) once_[k] = shared_[k] = common_[k] = none<S>(), dof_[k] = -1;
  for (int first = 0, end; first < count_; first = end) {
    end = next_link(first);
    const Occupied<S> lanes = occupied(first, end);
    const dynamics::ContactRows<S>& rows = active_[first].rows;
    for (int k = 0; k < rows.depth; ++k) {
      const int j = flat(rows.path[k]);
      common_[j] = common_[j] | (once_[j] & lanes.once);
      shared_[j] = shared_[j] | lanes.twice | common_[j];
      once_[j] = once_[j] | lanes.once;
    }
  }
}

/// Joints that several contacts of a lane share, in the order of the joints: so a lane meets its
/// dofs in an order that does not depend on the others.
template <class S>
void ContactStage<S>::number_shared_dofs(const dynamics::Tree<S>& tree) {
  const auto joint = [&](dynamics::LinkIndex l) { return tree.slots[l.slot].joint[l.lane]; };
  for (int i = 0; i < count_; i = next_link(i))
    for (int k = 0; k < active_[i].rows.depth; ++k) {
      const dynamics::LinkIndex link = active_[i].rows.path[k];
      if (dof_[flat(link)] >= 0 || !any(shared_[flat(link)])) continue;
      dof_[flat(link)] = active_[i].rows.depth - 1 - k;  // for now, its depth
      int at = num_shared_++;
      for (; at > 0 && joint(link_of_dof_[at - 1]) > joint(link); --at)
        link_of_dof_[at] = link_of_dof_[at - 1];
      link_of_dof_[at] = link;
    }
  const int first = tables_->floating ? 6 : 0;
  for (int k = 0; k < num_shared_; ++k) {
    int& dof = dof_[flat(link_of_dof_[k])];
    odd_[first + k] = dof & 1;
    dof = first + k;
  }
}

template <class S>
void ContactStage<S>::build_problem(dynamics::Tree<S>& tree, const S* friction, bool with_x) {
  compute_rows(tree);
  const int base_dofs = tables_->floating ? 6 : 0;
  num_shared_ = 0;
  if (!apart()) {
    find_shared_joints();
    number_shared_dofs(tree);
  }
  problem_.clear(base_dofs + num_shared_, num_shared_ > 0 ? odd_ : nullptr);
  if (with_x) {
    for (int k = 0; k < base_dofs; ++k) problem_.w0[k] = tree.base.x[k];
    for (int k = 0; k < num_shared_; ++k) {
      const dynamics::LinkIndex link = link_of_dof_[k];
      problem_.w0[base_dofs + k] = dynamics::lane_of<S>(tree.links[link.slot].x, link.lane);
    }
  }
  for (int i = 0; i < count_; ++i) fill_contact(tree, active_[i], friction, with_x);
  for (int i = 0; i < num_touching_; ++i) add_body(touching_[i]);
}

/// A joint is the link's own in lanes where no contact of another body is below it.
template <class S>
void ContactStage<S>::add_body(const TouchingLink<S>& t) {
  contact::ContactBody<S>& body = problem_.add_body(t.first, t.end, t.several);
  for (int i = t.first; i < t.end; ++i) {
    const Vec3<S> arm = active_[i].position - t.origin;
    S* to = problem_.contact(i).arm;
    to[0] = arm.x, to[1] = arm.y, to[2] = arm.z;
  }
  S column[6];
  const auto set_column = [&](Mask<S> lanes, const Row3<S>& linear, const Row3<S>& angular)
                              STICKSLIP_LAMBDA {
                                store(row_where(lanes, linear), column);
                                store(row_where(lanes, angular), column + 3);
                              };
  for (int k = 0; k < (tables_->floating ? 6 : 0); ++k) {
    set_column(t.several, t.linear.base[k], t.angular.base[k]);
    body.add_left(k, column);
  }
  for (int k = t.linear.depth - 1; k >= 0; --k) {
    const dynamics::LinkIndex joint = t.linear.path[k];
    const int dof = shared_dof(joint);
    if (dof < 0) continue;
    const Mask<S> common = t.several & common_[flat(joint)], own = t.several & !common;
    if (any(own)) {
      set_column(own, t.linear.joint[k], t.angular.joint[k]);
      body.add_own(column);
    }
    if (any(common)) {
      set_column(common, t.linear.joint[k], t.angular.joint[k]);
      body.add_left(dof, column);
    }
  }
}

template <class S>
void ContactStage<S>::fill_contact(const dynamics::Tree<S>& tree, const ActiveContact<S>& a,
                                   const S* friction, bool with_x) {
  const int number = problem_.append();
  contact::FactoredContact<S>& c = problem_.contact(number);  // its base columns are there already
  Row3<S> offset = make_row3(a.velocity.x, a.velocity.y, a.velocity.z + a.shift);
  contact::Symmetric3<S> own = contact::zero_symmetric<S>();  // the private block
  const auto add_private = [&](dynamics::LinkIndex link, const Row3<S>& row) STICKSLIP_LAMBDA {
    own.add_square(row);
    if (with_x)
      offset = madd(row, dynamics::lane_of<S>(tree.links[link.slot].x, link.lane), offset);
  };
  int touched = tables_->floating ? 6 : 0;
  if (num_shared_ > 0) {
    for (int k = 0; k < touched; ++k) index_[k] = k;
    for (int k = a.rows.depth - 1; k >= 0; --k) {
      const dynamics::LinkIndex link = a.rows.path[k];
      const Row3<S>& row = a.rows.joint[k];
      const int dof = shared_dof(link);
      if (dof < 0) {
        add_private(link, row);
        continue;
      }
      const Mask<S> shared = shared_[flat(link)];
      c.y[touched] = row_where(shared, row);
      index_[touched++] = dof;
      if (any(a.active & !shared)) add_private(link, row_where(!shared, row));
    }
  } else {
    for (int k = a.rows.depth - 1; k >= 0; --k) add_private(a.rows.path[k], a.rows.joint[k]);
  }
  if (num_shared_ > 0 || !tables_->floating) problem_.set_index(number, index_, touched);
  own.store_to(c.private_block);
  store(offset, c.offset);
  c.friction = friction[a.shape];
  c.active = a.active;
}

}  // namespace stickslip::step::inline STICKSLIP_KERNELS
