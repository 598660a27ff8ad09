#include "world/robot_scene.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "layout/ground_shapes.h"

namespace stickslip::world {
namespace {

int longest_path(const layout::TreeLayout& layout) {
  int deepest = 0;
  for (int j = 0; j < layout.num_joints; ++j) {
    int depth = 0;
    for (int k = j; k >= 0; k = layout.parent_joint[k]) ++depth;
    deepest = std::max(deepest, depth);
  }
  return deepest;
}

template <class F>
void for_joints_above(const layout::TreeLayout& layout, dynamics::LinkIndex link, const F& f) {
  if (link.slot == dynamics::kBaseSlot) return;
  for (int j = layout.slots[link.slot].joint[link.lane]; j >= 0; j = layout.parent_joint[j]) f(j);
}

/// Per shape, whether no joint above it moves more than one support point.
std::unique_ptr<bool[]> find_apart(const std::vector<collide::GroundShape>& shapes,
                                   const layout::TreeLayout& layout) {
  std::vector<int> points(layout.num_joints);  // that a joint moves
  for (const collide::GroundShape& s : shapes)
    for_joints_above(layout, s.link, [&](int j) { points[j] += s.num_points; });
  std::unique_ptr<bool[]> apart(new bool[shapes.size()]);
  for (size_t k = 0; k < shapes.size(); ++k) {
    apart[k] = true;
    for_joints_above(layout, shapes[k].link, [&](int j) { apart[k] = apart[k] && points[j] == 1; });
  }
  return apart;
}

/// Shapes sorted by body, so that contacts of a body follow each other whatever else touches.
std::vector<int> sort_by_body(const std::vector<collide::GroundShape>& shapes) {
  std::vector<int> order(shapes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return shapes[a].body < shapes[b].body; });
  return order;
}

/// Links but body 0 that can touch in several points.
int count_touching(const std::vector<collide::GroundShape>& shapes) {
  std::map<int, int> points;
  for (const collide::GroundShape& s : shapes)
    if (s.link.slot != dynamics::kBaseSlot) points[s.body] += s.num_points;
  return static_cast<int>(std::count_if(points.begin(), points.end(),
                                        [](const auto& body) { return body.second > 1; }));
}

/// How much of the last change of its impulse a point of each shape is expected to make again
/// (docs/theory/solvers.md (C26a)): nearly all of it where three joints or more are its own, and so
/// its impulse is determined. Elsewhere part of the impulses may only press the points against each
/// other. No solve damps that part, this factor has to.
std::vector<double> foresight(const std::vector<collide::GroundShape>& shapes,
                              const layout::TreeLayout& layout, const bool* apart) {
  std::vector<double> part;
  for (size_t k = 0; k < shapes.size(); ++k) {
    int joints = 0;
    for_joints_above(layout, shapes[k].link, [&](int) { ++joints; });
    part.push_back(apart[k] && joints >= 3 ? 0.98 : 0.9);
  }
  return part;
}

}  // namespace

RobotScene::RobotScene(const Model& model, const layout::TreeLayout& layout,
                       const RobotOptions& options)
    : shapes_(layout::ground_shapes(model, layout)),
      laws_(shapes_.size()),
      friction_(shapes_.size()),
      restitution_(shapes_.size()),
      threshold_(shapes_.size()),
      by_body_(sort_by_body(shapes_)),
      apart_(find_apart(shapes_, layout)),
      foresight_(foresight(shapes_, layout, apart_.get())),
      prismatic_(new bool[model.num_joints()]),
      tables_{} {
  for (size_t k = 0; k < shapes_.size(); ++k) set_law(static_cast<int>(k), {});
  for (int j = 0; j < model.num_joints(); ++j) {
    const Joint& joint = model.joints()[j];
    damping_.push_back(joint.damping);
    tables_.damped = tables_.damped || joint.damping > 0;
    prismatic_[j] = joint.type == JointType::kPrismatic;
  }
  step::RobotTables& t = tables_;
  t.floating = layout.floating;
  t.nq = model.nq(), t.nu = model.nu();
  t.num_joints = model.num_joints(), t.num_bodies = static_cast<int>(model.bodies().size());
  t.num_slots = layout.num_slots;
  t.max_depth = longest_path(layout);
  t.num_shapes = static_cast<int>(shapes_.size());
  t.num_points = layout::total_points(shapes_);
  t.num_touching = count_touching(shapes_);
  t.shapes = shapes_.data();
  t.by_body = by_body_.data();
  t.restitution = restitution_.data();
  t.restitution_threshold = threshold_.data();
  t.apart = apart_.get();
  t.foresight = foresight_.data();
  t.damping = damping_.data();
  t.prismatic = prismatic_.get();
  t.body_links = layout.link_of_body.data();
  std::copy(options.position.begin(), options.position.end(), t.fixed_position);
  std::copy(options.orientation.begin(), options.orientation.end(), t.fixed_quaternion);
}

void RobotScene::set_law(int shape, const MaterialPair& law) {
  laws_[shape] = law;
  friction_[shape] = law.friction;
  restitution_[shape] = law.restitution;
  threshold_[shape] = law.restitution_threshold;
}

}  // namespace stickslip::world
