#include "layout/ground_shapes.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "model/pose.h"

namespace stickslip::layout {
namespace {

using collide::GroundShape;
using collide::GroundShapeType;

/// None for a shape that no contact is computed for.
std::optional<GroundShapeType> ground_type(ShapeType type) {
  switch (type) {
    case ShapeType::kSphere:
      return GroundShapeType::kSphere;
    case ShapeType::kBox:
      return GroundShapeType::kBox;
    case ShapeType::kCapsule:
      return GroundShapeType::kCapsule;
    case ShapeType::kCylinder:
      return GroundShapeType::kCylinder;
    case ShapeType::kMesh:
      break;
  }
  return std::nullopt;
}

int points_of(GroundShapeType type) {
  switch (type) {
    case GroundShapeType::kSphere:
      return 1;
    case GroundShapeType::kCapsule:
      return 2;
    case GroundShapeType::kBox:
    case GroundShapeType::kCylinder:
      break;
  }
  return 8;
}

/// Lengths of a shape from the numbers that a Model gives.
void set_size(GroundShape& g, const Vector3& size) {
  const auto set_half = [&g](double x, double y, double z) {
    g.half[0] = x, g.half[1] = y, g.half[2] = z;
  };
  switch (g.type) {
    case GroundShapeType::kSphere:
      g.radius = g.bounding_radius = size[0];
      break;
    case GroundShapeType::kBox:
      set_half(size[0] / 2, size[1] / 2, size[2] / 2);
      g.bounding_radius =
          std::sqrt(g.half[0] * g.half[0] + g.half[1] * g.half[1] + g.half[2] * g.half[2]);
      break;
    case GroundShapeType::kCapsule:
      g.radius = size[0];
      set_half(size[0], size[0], size[1] / 2);
      g.bounding_radius = size[0] + size[1] / 2;
      break;
    case GroundShapeType::kCylinder:
      set_half(size[0], size[0], size[1] / 2);
      g.bounding_radius = std::sqrt(g.half[0] * g.half[0] + g.half[2] * g.half[2]);
  }
}

}  // namespace

std::vector<GroundShape> ground_shapes(const Model& model, const TreeLayout& layout) {
  std::vector<GroundShape> out;
  int points = 0;
  for (size_t i = 0; i < model.shapes().size(); ++i) {
    const Shape& s = model.shapes()[i];
    const std::optional<GroundShapeType> type = ground_type(s.type);
    // A fixed base does not move: its shapes can never start or end a contact.
    if (!type || (s.body == 0 && !layout.floating)) continue;
    GroundShape g{};
    g.link = layout.link_of_body[s.body];
    g.body = s.body;
    g.shape = static_cast<int>(i);
    g.type = *type;
    const Vector3 c = layout.turned(s.body, s.pose.position);
    std::copy(c.begin(), c.end(), g.center);
    const Matrix3 axes = multiply(transpose(layout.turn[s.body]), s.pose.rotation);
    std::copy(axes.begin(), axes.end(), g.axes);
    set_size(g, s.size);
    g.first_point = points;
    g.num_points = points_of(*type);
    points += g.num_points;
    out.push_back(g);
  }
  return out;
}

bool makes_contact(ShapeType type) { return ground_type(type).has_value(); }

std::vector<int> unsupported_shapes(const Model& model) {
  std::vector<int> out;
  for (size_t i = 0; i < model.shapes().size(); ++i)
    if (!makes_contact(model.shapes()[i].type)) out.push_back(static_cast<int>(i));
  return out;
}

int total_points(const std::vector<GroundShape>& shapes) {
  return shapes.empty() ? 0 : shapes.back().first_point + shapes.back().num_points;
}

}  // namespace stickslip::layout
