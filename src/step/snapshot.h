// Saving what changes in a step as bytes, and reading it back only if it fits.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "step/robot_data.h"

namespace stickslip::step {

struct Snapshot {
  double time = 0;
  std::vector<RobotState> robots;
};

std::vector<std::uint8_t> write_snapshot(double time, const std::vector<const RobotState*>& robots);

/// `shapes`: states of the robots that the snapshot must fit. Throws ModelError.
Snapshot read_snapshot(std::span<const std::uint8_t> blob,
                       const std::vector<const RobotState*>& shapes);

}  // namespace stickslip::step
