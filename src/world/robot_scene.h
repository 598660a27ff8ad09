// One robot on its ground as tables for the step, made from a model and how the robot was added.
// Owns what RobotTables points to.
#pragma once
#include <stickslip/world.h>

#include <memory>
#include <vector>

#include "layout/tree_layout.h"
#include "step/step_tables.h"

namespace stickslip::world {

class RobotScene {
 public:
  /// `layout` must outlive the scene.
  RobotScene(const Model& model, const layout::TreeLayout& layout, const RobotOptions& options);
  RobotScene(const RobotScene&) = delete;
  RobotScene& operator=(const RobotScene&) = delete;

  const step::RobotTables& tables() const { return tables_; }
  const std::vector<collide::GroundShape>& shapes() const { return shapes_; }
  /// Contact law of one of `shapes()`.
  void set_law(int shape, const MaterialPair& law);
  const MaterialPair& law(int shape) const { return laws_[shape]; }
  const std::vector<double>& friction() const { return friction_; }  ///< per shape [1]

 private:
  std::vector<collide::GroundShape> shapes_;
  std::vector<MaterialPair> laws_;
  std::vector<double> friction_, restitution_, threshold_, damping_;
  std::vector<int> by_body_;
  std::unique_ptr<bool[]> apart_;
  std::vector<double> foresight_;
  std::unique_ptr<bool[]> prismatic_;
  step::RobotTables tables_;
};

}  // namespace stickslip::world
