#include "backend/cpu/body_parameters.h"

#include <cstring>
#include <utility>

namespace stickslip::backend {

void BodyParameters::allocate(BatchMemory& memory) {
  std::size_t row = 0;
  for (const BatchField f : kFields) {
    memory.data(f);
    row += memory.row(f) * number_bytes();
  }
  const std::size_t per_link = static_cast<std::size_t>(kNumbers) * lanes() * number_bytes();
  const long packs = padded_ / kernels_.width;
  using world::AlignedBlock;  // all or none
  AlignedBlock links(packs * layout_.num_slots * per_link),
      base(static_cast<std::size_t>(padded_) * kNumbers * number_bytes()), seen(padded_ * row);
  links_ = std::move(links), base_ = std::move(base), seen_ = std::move(seen);
  for (long env = 0; env < padded_; ++env) {
    char* seen = seen_.data() + env * row;
    for (const BatchField f : kFields) {
      const std::size_t bytes = memory.row(f) * number_bytes();
      std::memcpy(seen, memory.shared_row(f), bytes);
      seen += bytes;
    }
    for (int slot = 0; slot < layout_.num_slots; ++slot)
      for (int lane = 0; lane < kernels_.bundle_lanes; ++lane)
        put_link(env, slot, lane, layout_.links[slot * dynamics::kMaxLanes + lane].inertial);
    put_base(env, layout_.turned_inertia(0, layout_.base));
  }
}

void BodyParameters::refresh(BatchMemory& memory, long pack) {
  for (long place = pack * kernels_.width; place < (pack + 1) * kernels_.width; ++place) {
    const long env = grouping_.order()[place];
    std::size_t row = 0;
    for (const BatchField f : kFields) row += memory.row(f) * number_bytes();
    char* seen = seen_.data() + env * row;
    bool changed = false;
    for (const BatchField f : kFields) {
      const std::size_t bytes = memory.row(f) * number_bytes();
      const char* now = memory.data(f) + env * bytes;
      if (std::memcmp(seen, now, bytes) != 0) {
        changed = true;
        std::memcpy(seen, now, bytes);
      }
      seen += bytes;
    }
    if (changed) turn(memory, env);
  }
}

Inertial BodyParameters::inertial(BatchMemory& memory, long env, int body) const {
  Inertial i;
  i.mass = memory.get(BatchField::kBodyMass, env, body);
  for (int k = 0; k < 3; ++k)
    i.center_of_mass[k] = memory.get(BatchField::kBodyCom, env, 3 * body + k);
  for (int k = 0; k < 6; ++k)
    i.inertia[k] = memory.get(BatchField::kBodyInertia, env, 6 * body + k);
  return i;
}

void BodyParameters::turn(BatchMemory& memory, long env) {
  // A body that is as in the model keeps the model's numbers, which were turned before they were
  // rounded.
  const auto unchanged = [&](int body) {
    for (const BatchField f : kFields) {
      const long n = memory.row(f) / memory.row(BatchField::kBodyMass);
      const std::size_t bytes = n * number_bytes();
      if (std::memcmp(memory.data(f) + env * memory.row(f) * number_bytes() + body * bytes,
                      memory.shared_row(f) + body * bytes, bytes) != 0)
        return false;
    }
    return true;
  };
  put_base(env, layout_.turned_inertia(0, unchanged(0) ? layout_.base : inertial(memory, env, 0)));
  for (int slot = 0; slot < layout_.num_slots; ++slot)
    for (int lane = 0; lane < kernels_.bundle_lanes; ++lane) {
      const int body = layout_.slots[slot].joint[lane] + 1;
      put_link(env, slot, lane,
               layout_.turned_inertia(body, unchanged(body) ? model_.bodies()[body].inertial
                                                            : inertial(memory, env, body)));
    }
}

void BodyParameters::put_link(long env, int slot, int lane,
                              const dynamics::LinkInertia<double>& inertia) {
  const NumberType type = kernels_.single ? NumberType::kFloat32 : NumberType::kFloat64;
  const long place = grouping_.place(env), w = kernels_.width;
  const long link = place / w * layout_.num_slots + slot;
  for (int k = 0; k < kNumbers; ++k)
    set_number(links_.data(), type, (link * kNumbers + k) * lanes() + (w > 1 ? place % w : lane),
               reinterpret_cast<const double*>(&inertia)[k]);
}

void BodyParameters::put_base(long env, const dynamics::LinkInertia<double>& inertia) {
  const NumberType type = kernels_.single ? NumberType::kFloat32 : NumberType::kFloat64;
  for (int k = 0; k < kNumbers; ++k)
    set_number(base_.data(), type, number_at(grouping_.place(env), k, kNumbers, kernels_.width),
               reinterpret_cast<const double*>(&inertia)[k]);
}

const void* BodyParameters::links(long pack) const {
  return links_.data() +
         pack * layout_.num_slots * kNumbers * static_cast<long>(lanes()) * number_bytes();
}
const void* BodyParameters::base(long pack) const {
  return base_.data() + pack * kNumbers * static_cast<long>(kernels_.width) * number_bytes();
}

}  // namespace stickslip::backend
