#include "collide/ground_shapes.h"

#include <algorithm>
#include <cmath>

#include "model/pose.h"

namespace stickslip::collide {
namespace {

int points_of(ShapeType type) {
  switch (type) {
    case ShapeType::kSphere:
      return 1;
    case ShapeType::kCapsule:
      return 2;
    case ShapeType::kBox:
    case ShapeType::kCylinder:
      return 8;
    case ShapeType::kMesh:
      return 0;
  }
  return 0;
}

}  // namespace

std::vector<GroundShape> ground_shapes(const Model& model, const dynamics::TreeLayout& layout) {
  std::vector<GroundShape> out;
  int points = 0;
  for (size_t i = 0; i < model.shapes().size(); ++i) {
    const Shape& s = model.shapes()[i];
    // A fixed base does not move: its shapes can never start or end a contact.
    if (points_of(s.type) == 0 || (s.body == 0 && !layout.floating)) continue;
    GroundShape g{};
    g.link = layout.link_of_body[s.body];
    g.body = s.body;
    g.shape = static_cast<int>(i);
    g.type = s.type;
    const Vector3 c = layout.turned(s.body, s.pose.position);
    std::copy(c.begin(), c.end(), g.center);
    const Matrix3 axes = multiply(transpose(layout.turn[s.body]), s.pose.rotation);
    std::copy(axes.begin(), axes.end(), g.axes);
    const auto set_half = [&g](double x, double y, double z) {
      g.half[0] = x, g.half[1] = y, g.half[2] = z;
    };
    switch (s.type) {
      case ShapeType::kSphere:
        g.radius = g.bounding_radius = s.size[0];
        break;
      case ShapeType::kBox:
        set_half(s.size[0] / 2, s.size[1] / 2, s.size[2] / 2);
        g.bounding_radius =
            std::sqrt(g.half[0] * g.half[0] + g.half[1] * g.half[1] + g.half[2] * g.half[2]);
        break;
      case ShapeType::kCapsule:
        g.radius = s.size[0];
        set_half(s.size[0], s.size[0], s.size[1] / 2);
        g.bounding_radius = s.size[0] + s.size[1] / 2;
        break;
      default:
        set_half(s.size[0], s.size[0], s.size[1] / 2);
        g.bounding_radius = std::sqrt(g.half[0] * g.half[0] + g.half[2] * g.half[2]);
    }
    g.first_point = points;
    g.num_points = points_of(s.type);
    points += g.num_points;
    out.push_back(g);
  }
  return out;
}

std::vector<int> unsupported_shapes(const Model& model) {
  std::vector<int> out;
  for (size_t i = 0; i < model.shapes().size(); ++i)
    if (points_of(model.shapes()[i].type) == 0) out.push_back(static_cast<int>(i));
  return out;
}

int total_points(const std::vector<GroundShape>& shapes) {
  return shapes.empty() ? 0 : shapes.back().first_point + shapes.back().num_points;
}

}  // namespace stickslip::collide
