#include "collide/ground_shapes.h"

#include <cmath>

#include "model/pose.h"

namespace stickslip::collide {
namespace {

Vec3<double> column(const Mat3<double>& m, int k) { return {m.m[k], m.m[3 + k], m.m[6 + k]}; }

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

/// Center of support point `point` of a cylinder: cap = point / 4, rim direction = point % 4.
Vec3<double> rim_point(const GroundShape& shape, const PlacedShape& placed, int point) {
  const Vec3<double> axis = column(placed.axes, 2);
  // Direction in the cap that goes down fastest; any direction when the cap is level.
  Vec3<double> down{axis.z * axis.x, axis.z * axis.y, axis.z * axis.z - 1};
  const double n = std::sqrt(dot(down, down));
  down = n > 1e-9 ? down * (1 / n) : column(placed.axes, 0);
  const Vec3<double> side = cross(axis, down);
  const double along = point < 4 ? -shape.half.z : shape.half.z;
  const int k = point % 4;
  const Vec3<double> rim = k < 2 ? down : side;
  return madd(rim, k % 2 ? -shape.half.x : shape.half.x, madd(axis, along, placed.center));
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
    g.center = {c[0], c[1], c[2]};
    const Matrix3 axes = multiply(transpose(layout.turn[s.body]), s.pose.rotation);
    for (int k = 0; k < 9; ++k) g.axes.m[k] = axes[k];
    switch (s.type) {
      case ShapeType::kSphere:
        g.radius = g.bounding_radius = s.size[0];
        break;
      case ShapeType::kBox:
        g.half = {s.size[0] / 2, s.size[1] / 2, s.size[2] / 2};
        g.bounding_radius = std::sqrt(dot(g.half, g.half));
        break;
      case ShapeType::kCapsule:
        g.radius = s.size[0];
        g.half = {s.size[0], s.size[0], s.size[1] / 2};
        g.bounding_radius = s.size[0] + s.size[1] / 2;
        break;
      default:
        g.half = {s.size[0], s.size[0], s.size[1] / 2};
        g.bounding_radius = std::sqrt(g.half.x * g.half.x + g.half.z * g.half.z);
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

PlacedShape place(const dynamics::Tree<double>& tree, const GroundShape& shape) {
  PlacedShape p;
  p.center = dynamics::point_position(tree, shape.link, shape.center);
  if (shape.type == ShapeType::kSphere) {
    p.lowest = p.center.z - shape.radius;
    return p;
  }
  const Mat3<double> r =
      shape.link.slot == dynamics::kBaseSlot
          ? tree.base.rotation
          : dynamics::field_of<double, Mat3>(
                tree, shape.link, &dynamics::LinkState<dynamics::Wide<double>>::rotation);
  p.axes = r * shape.axes;
  const Vec3<double> z{p.axes.m[6], p.axes.m[7], p.axes.m[8]};
  if (shape.type == ShapeType::kBox)
    p.lowest = p.center.z - (std::fabs(z.x) * shape.half.x + std::fabs(z.y) * shape.half.y +
                             std::fabs(z.z) * shape.half.z);
  else  // capsule; a cylinder lies inside the capsule-like bound radius + half length * |axis|
    p.lowest = p.center.z - (shape.half.x + std::fabs(z.z) * shape.half.z);
  return p;
}

Vec3<double> support_point(const GroundShape& shape, const PlacedShape& placed, int point) {
  Vec3<double> c = placed.center;
  const auto sign = [&](int bit) { return point & bit ? 1.0 : -1.0; };
  switch (shape.type) {
    case ShapeType::kBox:
      c = madd(column(placed.axes, 0), sign(1) * shape.half.x, c);
      c = madd(column(placed.axes, 1), sign(2) * shape.half.y, c);
      c = madd(column(placed.axes, 2), sign(4) * shape.half.z, c);
      break;
    case ShapeType::kCapsule:
      c = madd(column(placed.axes, 2), sign(1) * shape.half.z, c);
      break;
    case ShapeType::kCylinder:
      c = rim_point(shape, placed, point);
      break;
    default:
      break;
  }
  c.z -= shape.radius;
  return c;
}

}  // namespace stickslip::collide
