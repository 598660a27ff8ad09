// Support points of shapes against a horizontal plane: a center and a radius each; a point touches
// the plane straight below its center.
#pragma once
#include "collide/ground_shape.h"
#include "dynamics/kinematics.h"

namespace stickslip::collide::inline STICKSLIP_KERNELS {

/// A shape placed in the world, relative to the base origin.
template <class S>
struct PlacedShape {
  Vec3<S> center;
  Mat3<S> axes;  // a sphere has none
};

template <class S>
STICKSLIP_INLINE Vec3<S> constant3(const double v[3]) {
  return {constant<S>(v[0]), constant<S>(v[1]), constant<S>(v[2])};
}
template <class S>
STICKSLIP_INLINE Vec3<S> column(const Mat3<S>& m, int k) {
  return {m.m[k], m.m[3 + k], m.m[6 + k]};
}

template <class S>
STICKSLIP_INLINE Vec3<S> shape_center(const dynamics::Tree<S>& tree, const GroundShape& shape) {
  return dynamics::point_position(tree, shape.link, constant3<S>(shape.center));
}

/// Of the shape on its link.
template <class S>
STICKSLIP_INLINE Mat3<S> shape_rotation(const GroundShape& shape) {
  Mat3<S> axes;
  for (int k = 0; k < 9; ++k) axes.m[k] = constant<S>(shape.axes[k]);
  return axes;
}

/// Height of the lowest point of a shape above the base origin, never too high: all that a shape
/// far from the ground needs.
template <class S>
STICKSLIP_INLINE S lowest_point(const dynamics::Tree<S>& tree, const GroundShape& shape) {
  const S center = dynamics::point_height(tree, shape.link, constant3<S>(shape.center));
  if (shape.type == GroundShapeType::kSphere) return center - constant<S>(shape.radius);
  const Vec3<S> up = dynamics::heights_of_axes(tree, shape.link);
  const Mat3<S> axes = shape_rotation<S>(shape);
  const auto reach = [&](int k) {
    return abs(dot(up, column(axes, k))) * constant<S>(shape.half[k]);
  };
  if (shape.type == GroundShapeType::kBox) return center - (reach(0) + reach(1) + reach(2));
  // A capsule; a cylinder lies inside the capsule-like bound radius + half length * |axis|.
  return center - (constant<S>(shape.half[0]) + reach(2));
}

/// Center and axes, for `support_point`.
template <class S>
PlacedShape<S> place(const dynamics::Tree<S>& tree, const GroundShape& shape) {
  PlacedShape<S> p;
  p.center = shape_center(tree, shape);
  if (shape.type != GroundShapeType::kSphere)
    p.axes = dynamics::link_rotation(tree, shape.link) * shape_rotation<S>(shape);
  return p;
}

/// Center of support point `point` of a cylinder: cap = point / 4, rim direction = point % 4.
template <class S>
STICKSLIP_INLINE Vec3<S> rim_point(const GroundShape& shape, const PlacedShape<S>& placed,
                                   int point) {
  const S one = constant<S>(1);
  const Vec3<S> axis = column(placed.axes, 2), level = column(placed.axes, 0);
  // Direction in the cap that goes down fastest; any direction when the cap is level.
  const Vec3<S> fall{axis.z * axis.x, axis.z * axis.y, axis.z * axis.z - one};
  const S n = sqrt(dot(fall, fall));
  const auto tilted = n > constant<S>(1e-9);
  const S inverse = one / select(tilted, n, one);
  const Vec3<S> down{select(tilted, fall.x * inverse, level.x),
                     select(tilted, fall.y * inverse, level.y),
                     select(tilted, fall.z * inverse, level.z)};
  const Vec3<S> side = cross(axis, down);
  const double along = point < 4 ? -shape.half[2] : shape.half[2];
  const int k = point % 4;
  const Vec3<S> rim = k < 2 ? down : side;
  return madd(rim, constant<S>(k % 2 ? -shape.half[0] : shape.half[0]),
              madd(axis, constant<S>(along), placed.center));
}

/// Where support point `point` (0 .. num_points - 1) of a placed shape touches first: its lowest
/// point, relative to the base origin, world axes.
template <class S>
Vec3<S> support_point(const GroundShape& shape, const PlacedShape<S>& placed, int point) {
  Vec3<S> c = placed.center;
  const auto half = [&](int axis, int bit) {
    return constant<S>((point & bit ? 1.0 : -1.0) * shape.half[axis]);
  };
  switch (shape.type) {
    case GroundShapeType::kBox:
      c = madd(column(placed.axes, 0), half(0, 1), c);
      c = madd(column(placed.axes, 1), half(1, 2), c);
      c = madd(column(placed.axes, 2), half(2, 4), c);
      break;
    case GroundShapeType::kCapsule:
      c = madd(column(placed.axes, 2), half(2, 1), c);
      break;
    case GroundShapeType::kCylinder:
      c = rim_point(shape, placed, point);
      break;
    default:
      break;
  }
  c.z = c.z - constant<S>(shape.radius);
  return c;
}

}  // namespace stickslip::collide::inline STICKSLIP_KERNELS
