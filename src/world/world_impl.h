// What is behind a World: options, ground, materials, robots. Batches read it too.
#pragma once
#include <map>
#include <utility>

#include "world/robot_impl.h"

namespace stickslip {

struct World::Impl {
  explicit Impl(const WorldOptions& o);

  MaterialPair pair(const std::string& a, const std::string& b) const;
  void refresh_laws();
  world::RobotData& data(int robot) const { return robots[robot]->impl_->data; }

  WorldOptions options;
  step::StepSettings settings;
  Vec3<double> gravity;
  std::string ground_material = "default";
  std::map<std::pair<std::string, std::string>, MaterialPair> pairs;
  std::vector<std::unique_ptr<Robot>> robots;
  double stages[step::kNumStages] = {};
  long profiled_steps = 0;
  mutable StageTimes times;
  double time = 0;
};

}  // namespace stickslip
