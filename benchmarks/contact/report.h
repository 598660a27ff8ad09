// The results as text and as JSON.
#pragma once
#include "benchmarks/contact/measure.h"

namespace stickslip::benchmarks {

/// What one set came to.
struct SetResult {
  std::string name, group;
  int problems = 0;
  double mean_contacts = 0;
  std::vector<Measurement> measurements;  // one per method
};

/// Prints a table: solved shares, time, residual of every method.
void print_table(const SetResult& result, const Methods& methods);

/// Writes times and residuals of every problem; throws where the file cannot be written.
void write_json(const std::string& path, const std::vector<SetResult>& results,
                const Methods& methods);

}  // namespace stickslip::benchmarks
