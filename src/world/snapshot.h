// Saving what changes in a step as bytes, and reading it back only if it fits.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "world/robot_data.h"

namespace stickslip::world {

struct Snapshot {
  double time = 0;
  std::vector<RobotState> robots;
};

std::vector<std::uint8_t> write_snapshot(double time, const std::vector<const RobotData*>& robots);

/// `robots`: those that the snapshot must fit, by name and size. Throws ModelError.
Snapshot read_snapshot(std::span<const std::uint8_t> blob,
                       const std::vector<const RobotData*>& robots);

}  // namespace stickslip::world
