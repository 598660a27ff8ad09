// The arrays of a batch: how many numbers of which type an environment has of each, and their
// memory.
#pragma once
#include <stickslip/batch.h>

#include <array>

#include "step/step_tables.h"
#include "world/aligned_block.h"

namespace stickslip::backend {

std::size_t size_of(NumberType type);

class BatchMemory {
 public:
  /// `padded`: num_envs rounded up to whole packs.
  BatchMemory(const step::RobotTables& tables, Precision precision, long num_envs, long padded);

  /// The memory of a field, (padded, row); parameters are filled with their shared row on first
  /// use.
  char* data(BatchField field);
  bool has(BatchField field) const { return bool(fields_[static_cast<int>(field)].block); }
  BatchArray array(BatchField field);
  long row(BatchField field) const;  // numbers per environment
  NumberType type(BatchField field) const { return fields_[static_cast<int>(field)].type; }
  /// The row that all environments share until they have one each.
  char* shared_row(BatchField field) { return fields_[static_cast<int>(field)].shared.data(); }
  void set_shared_row(BatchField field, std::span<const double> values);
  std::size_t bytes() const;

  double get(BatchField field, long env, long k);
  void set(BatchField field, long env, long k, double value);

 private:
  struct Field {
    NumberType type;
    std::vector<int> shape;  // of one environment
    world::AlignedBlock block, shared;
  };
  static constexpr int kFields = static_cast<int>(BatchField::kExternalWrench) + 1;
  Field& field(BatchField f) { return fields_[static_cast<int>(f)]; }

  long num_envs_, padded_;
  std::array<Field, kFields> fields_;
};

/// Number k of an array of this type.
double get_number(const char* data, NumberType type, long k);
void set_number(char* data, NumberType type, long k, double value);

}  // namespace stickslip::backend
