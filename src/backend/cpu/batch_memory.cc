#include "backend/cpu/batch_memory.h"

#include <cstring>

namespace stickslip::backend {

std::size_t size_of(NumberType type) {
  switch (type) {
    case NumberType::kFloat32:
    case NumberType::kUint32:
      return 4;
    case NumberType::kFloat64:
      return 8;
    case NumberType::kUint8:
      return 1;
  }
  return 0;
}

double get_number(const char* data, NumberType type, long k) {
  switch (type) {
    case NumberType::kFloat32:
      return reinterpret_cast<const float*>(data)[k];
    case NumberType::kFloat64:
      return reinterpret_cast<const double*>(data)[k];
    case NumberType::kUint8:
      return reinterpret_cast<const std::uint8_t*>(data)[k];
    case NumberType::kUint32:
      return reinterpret_cast<const std::uint32_t*>(data)[k];
  }
  return 0;
}

void set_number(char* data, NumberType type, long k, double value) {
  switch (type) {
    case NumberType::kFloat32:
      reinterpret_cast<float*>(data)[k] = static_cast<float>(value);
      break;
    case NumberType::kFloat64:
      reinterpret_cast<double*>(data)[k] = value;
      break;
    case NumberType::kUint8:
      reinterpret_cast<std::uint8_t*>(data)[k] = static_cast<std::uint8_t>(value);
      break;
    case NumberType::kUint32:
      reinterpret_cast<std::uint32_t*>(data)[k] = static_cast<std::uint32_t>(value);
      break;
  }
}

BatchMemory::BatchMemory(const step::RobotTables& t, Precision precision, long num_envs,
                         long padded)
    : num_envs_(num_envs), padded_(padded) {
  const NumberType number =
      precision == Precision::kFloat32 ? NumberType::kFloat32 : NumberType::kFloat64;
  const auto define = [&](BatchField f, NumberType type, std::vector<int> shape) {
    field(f).type = type;
    field(f).shape = std::move(shape);
  };
  using enum BatchField;
  define(kQ, number, {t.nq});
  define(kU, number, {t.nu});
  define(kGeneralizedForce, number, {t.nu});
  define(kPdTarget, number, {t.num_joints});
  define(kContactImpulse, number, {t.num_points, 3});
  define(kContactActive, NumberType::kUint8, {t.num_points});
  define(kStatus, NumberType::kUint32, {});
  define(kResidual, number, {});
  define(kTime, NumberType::kFloat64, {});
  define(kKp, number, {t.num_joints});
  define(kKd, number, {t.num_joints});
  define(kFriction, number, {t.num_shapes});
  define(kGravity, number, {3});
  define(kBodyMass, number, {t.num_bodies});
  define(kBodyCom, number, {t.num_bodies, 3});
  define(kBodyInertia, number, {t.num_bodies, 6});
  define(kExternalWrench, number, {t.num_bodies, 6});
  for (const BatchField f : {kGeneralizedForce, kPdTarget, kKp, kKd, kFriction, kGravity, kBodyMass,
                             kBodyCom, kBodyInertia, kExternalWrench})
    field(f).shared = world::AlignedBlock(row(f) * size_of(type(f)));
}

long BatchMemory::row(BatchField f) const {
  long n = 1;
  for (const int k : fields_[static_cast<int>(f)].shape) n *= k;
  return n;
}

char* BatchMemory::data(BatchField f) {
  Field& x = field(f);
  if (x.block) return x.block.data();
  const std::size_t bytes = row(f) * size_of(x.type);
  x.block = world::AlignedBlock(padded_ * bytes);
  if (x.shared)
    for (long env = 0; env < padded_; ++env)
      std::memcpy(x.block.data() + env * bytes, x.shared.data(), bytes);
  return x.block.data();
}

BatchArray BatchMemory::array(BatchField f) {
  std::vector<int> shape{static_cast<int>(num_envs_)};
  shape.insert(shape.end(), field(f).shape.begin(), field(f).shape.end());
  return {data(f), type(f), shape};
}

void BatchMemory::set_shared_row(BatchField f, std::span<const double> values) {
  for (std::size_t k = 0; k < values.size(); ++k)
    set_number(shared_row(f), type(f), static_cast<long>(k), values[k]);
}

std::size_t BatchMemory::bytes() const {
  std::size_t sum = 0;
  for (const Field& f : fields_) sum += f.block.bytes() + f.shared.bytes();
  return sum;
}

double BatchMemory::get(BatchField f, long env, long k) {
  return get_number(data(f), type(f), env * row(f) + k);
}
void BatchMemory::set(BatchField f, long env, long k, double value) {
  set_number(data(f), type(f), env * row(f) + k, value);
}

}  // namespace stickslip::backend
