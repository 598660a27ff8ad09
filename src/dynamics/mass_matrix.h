// The mass matrix written out, by the composite-rigid-body algorithm [Featherstone 2008, sec. 6.2].
// For users and tests: a step never needs it (factor.h).
#pragma once
#include "dynamics/kinematics.h"

namespace stickslip::dynamics::inline STICKSLIP_KERNELS {

/// Row-major (nu, nu) into `out`, after compute_positions and compute_inertias. `composites` is
/// scratch (num_slots).
template <class S>
void compute_mass_matrix(const Tree<S>& t, RigidInertia<Wide<S>>* composites, S* out) {
  const int offset = t.floating ? 6 : 0, n = t.num_joints + offset;
  for (int i = 0; i < n * n; ++i) out[i] = constant<S>(0);
  for (int slot = 0; slot < t.num_slots; ++slot)
    composites[slot] = at_reference(t.links[slot].inertia);
  const auto put = [&](int i, int j, S value) { out[i * n + j] = out[j * n + i] = value; };
  const auto composite_of = [&](LinkIndex link) {
    const auto* from = reinterpret_cast<const Wide<S>*>(&composites[link.slot]);
    return Numbers<S, RigidInertia>::make([&](int k) { return lane_of<S>(from[k], link.lane); });
  };
  for (int ib = t.num_bundles - 1; ib >= 0; --ib)
    for (int slot = t.bundles[ib].first_slot + t.bundles[ib].length - 1;
         slot >= t.bundles[ib].first_slot; --slot)
      for (int lane = used_lanes<S>(t.bundles[ib]) - 1; lane >= 0; --lane) {
        const LinkIndex link{slot, lane};
        const int j = offset + t.slots[slot].joint[lane];
        const RigidInertia<S> inertia = composite_of(link);
        const Spatial<S> f = inertia * field_of<S, Spatial>(t, link, &LinkState<Wide<S>>::axis);
        LinkIndex above = link;
        for (; above.slot != kBaseSlot; above = t.slots[above.slot].parent[above.lane])
          put(j, offset + t.slots[above.slot].joint[above.lane],
              dot(f, field_of<S, Spatial>(t, above, &LinkState<Wide<S>>::axis)));
        if (t.floating) {
          const S column[6] = {f.lin.x, f.lin.y, f.lin.z, f.ang.x, f.ang.y, f.ang.z};
          for (int k = 0; k < 6; ++k) put(j, k, column[k]);
        }
        const LinkIndex parent = t.slots[slot].parent[lane];
        if (parent.slot == kBaseSlot) continue;
        for (int k = 0; k < kNumbersIn<RigidInertia>; ++k) {
          auto& to = reinterpret_cast<Wide<S>*>(&composites[parent.slot])[k];
          if constexpr (BundleScalar<S>::kLanes == 1)
            to = to + reinterpret_cast<const S*>(&inertia)[k];
          else
            set_lane(to, parent.lane,
                     get_lane(to, parent.lane) + reinterpret_cast<const S*>(&inertia)[k]);
        }
      }
  if (!t.floating) return;
  const RigidInertia<S>& c = t.base.composite;
  const S o = constant<S>(0);
  const S cross_h[9] = {o, -c.h.z, c.h.y, c.h.z, o, -c.h.x, -c.h.y, c.h.x, o};
  for (int i = 0; i < 3; ++i) {
    put(i, i, c.mass);
    for (int j = 0; j < 3; ++j) put(3 + i, j, cross_h[3 * i + j]);
  }
  const S rot[9] = {c.rot.xx, c.rot.xy, c.rot.xz, c.rot.xy, c.rot.yy,
                    c.rot.yz, c.rot.xz, c.rot.yz, c.rot.zz};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) put(3 + i, 3 + j, rot[3 * i + j]);
}

}  // namespace stickslip::dynamics::inline STICKSLIP_KERNELS
