// One lane of a pack (or a float problem) as a problem of its own in double, and its answer back.
//
// It is what a plain solve of that lane would have been given: contacts that the lane does not have
// and dofs that it does not touch are left out, so every number that is computed from it has the
// bits of the plain problem.
#pragma once
#include "contact/factored_problem.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Copies one lane of p, as the owner filled it, with the impulses, velocities and w that it has
/// now. q must hold as many contacts and dofs as p.
template <class S>
void extract_lane(const FactoredProblem<S>& p, int lane, FactoredProblem<double>& q) {
  q.clear(p.dofs(), p.odd());
  for (int k = 0; k < p.dofs(); ++k) {
    q.w0[k] = get_lane(p.w0[k], lane);
    q.w[k] = get_lane(p.w[k], lane);
  }
  for (int i = 0; i < p.size(); ++i) {
    const FactoredContact<S>& c = p.contact(i);
    if (!get_lane(c.active, lane)) continue;
    const int j = q.add();
    const int columns = p.six() ? 6 : c.count < 0 ? p.dofs() : c.count;
    int* index = q.contact(j).index;
    int count = 0;
    for (int k = 0; k < columns; ++k) {
      S row[3];
      store(c.y[k], row);
      double y[3];
      for (int r = 0; r < 3; ++r) y[r] = get_lane(row[r], lane);
      if (!p.six() && y[0] == 0 && y[1] == 0 && y[2] == 0) continue;
      index[count] = c.count < 0 || p.six() ? k : c.index[k];
      q.y(j)[count++] = make_row3(y[0], y[1], y[2]);
    }
    if (!p.six()) q.set_index(j, index, count);
    for (int r = 0; r < 3; ++r) {
      q.offset(j)[r] = get_lane(c.offset[r], lane);
      q.impulse(j)[r] = get_lane(c.impulse[r], lane);
      q.contact(j).velocity[r] = get_lane(c.velocity[r], lane);
    }
    for (int r = 0; r < 6; ++r) q.private_block(j)[r] = get_lane(c.private_block[r], lane);
    q.friction(j) = get_lane(c.friction, lane);
  }
}

/// Takes impulses, velocities and w of an extracted lane back; the other lanes stay as they are.
template <class S>
void insert_lane(const FactoredProblem<double>& q, int lane, FactoredProblem<S>& p) {
  using T = Value<S>;
  for (int i = 0, j = 0; i < p.size(); ++i) {
    FactoredContact<S>& c = p.contact(i);
    if (!get_lane(c.active, lane)) continue;
    for (int r = 0; r < 3; ++r) {
      set_lane(c.impulse[r], lane, T(q.contact(j).impulse[r]));
      set_lane(c.velocity[r], lane, T(q.contact(j).velocity[r]));
    }
    ++j;
  }
  for (int k = 0; k < p.dofs(); ++k) set_lane(p.w[k], lane, T(q.w[k]));
}

/// Calls f(problem, lane) with each of the lanes as a problem of its own in double, and takes the
/// impulses, velocities and w that f leaves in it. A plain double problem is handed over itself.
template <class S, class F>
void solve_lanes(FactoredProblem<S>& p, Mask<S> lanes, F&& f) {
  for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane) {
    if (!get_lane(lanes, lane)) continue;
    if constexpr (ScalarTraits<S>::kWidth == 1 && sizeof(S) == 8) {
      f(p, lane);
    } else {
      extract_lane(p, lane, *p.lane);
      f(*p.lane, lane);
      insert_lane(*p.lane, lane, p);
    }
  }
}

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
