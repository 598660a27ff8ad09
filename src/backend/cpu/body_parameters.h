// Mass properties of bodies, one set per environment, as kernels read them: turned link frames,
// lanes side by side. Users write them in body frames (BatchField::kBodyMass and its neighbors);
// what has changed is turned before the pack is stepped, in double like a model's.
#pragma once
#include <array>

#include "backend/cpu/batch_memory.h"
#include "backend/cpu/grouping.h"
#include "backend/cpu/pack_kernels.h"
#include "layout/tree_layout.h"

namespace stickslip::backend {

class BodyParameters {
 public:
  BodyParameters(const Model& model, const layout::TreeLayout& layout, const PackKernels& kernels,
                 const Grouping& grouping, long padded)
      : model_(model), layout_(layout), kernels_(kernels), grouping_(grouping), padded_(padded) {}

  bool used() const { return bool(links_); }
  /// Memory for all environments, filled with the model's.
  void allocate(BatchMemory& memory);
  /// Takes what the environments of a pack have changed.
  void refresh(BatchMemory& memory, long pack);
  /// LinkInertia of slots and of body 0, for a pack: see EnvArrays.
  const void* links(long pack) const;
  const void* base(long pack) const;
  /// What moves with an environment, (slots and body 0): see Grouping::regroup.
  std::array<LaneRows, 2> carried() {
    return {LaneRows{links_.data(), long{layout_.num_slots} * kNumbers, number_bytes()},
            LaneRows{base_.data(), kNumbers, number_bytes()}};
  }
  std::size_t bytes() const { return links_.bytes() + base_.bytes() + seen_.bytes(); }

 private:
  static constexpr int kNumbers = sizeof(dynamics::LinkInertia<double>) / sizeof(double);
  static constexpr BatchField kFields[] = {BatchField::kBodyMass, BatchField::kBodyCom,
                                           BatchField::kBodyInertia};

  int number_bytes() const { return kernels_.single ? 4 : 8; }
  int lanes() const { return kernels_.width > 1 ? kernels_.width : kernels_.bundle_lanes; }
  Inertial inertial(BatchMemory& memory, long env, int body) const;
  void put_link(long env, int slot, int lane, const dynamics::LinkInertia<double>& inertia);
  void put_base(long env, const dynamics::LinkInertia<double>& inertia);
  void turn(BatchMemory& memory, long env);

  const Model& model_;
  const layout::TreeLayout& layout_;
  const PackKernels& kernels_;
  const Grouping& grouping_;
  long padded_;
  world::AlignedBlock links_, base_;
  world::AlignedBlock seen_;  // the users' rows as they were turned last
};

}  // namespace stickslip::backend
