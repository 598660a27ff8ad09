// Support points of shapes against a horizontal plane: a center and a radius each; a point touches
// the plane straight below its center.
#pragma once
#include "collide/ground_shapes.h"
#include "dynamics/kinematics.h"

namespace stickslip::collide::inline STICKSLIP_KERNELS {

/// A shape placed in the world, relative to the base origin.
template <class S>
struct PlacedShape {
  Vec3<S> center;
  S lowest;      // height of its lowest point above the base origin, never too high
  Mat3<S> axes;  // see orient; a sphere has none
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

/// Rotation of the link and of the shape on it.
template <class S>
STICKSLIP_INLINE Mat3<S> link_rotation(const dynamics::Tree<S>& tree, const GroundShape& shape) {
  if (shape.link.slot == dynamics::kBaseSlot) return tree.base.rotation;
  return dynamics::field_of<S, Mat3>(tree, shape.link,
                                     &dynamics::LinkState<dynamics::Wide<S>>::rotation);
}
template <class S>
STICKSLIP_INLINE Mat3<S> shape_rotation(const GroundShape& shape) {
  Mat3<S> axes;
  for (int k = 0; k < 9; ++k) axes.m[k] = constant<S>(shape.axes[k]);
  return axes;
}

/// Center and lowest point, which is all that a shape far from the ground needs.
template <class S>
PlacedShape<S> place(const dynamics::Tree<S>& tree, const GroundShape& shape) {
  PlacedShape<S> p;
  p.center = shape_center(tree, shape);
  if (shape.type == ShapeType::kSphere) {
    p.lowest = p.center.z - constant<S>(shape.radius);
    return p;
  }
  // Heights of the tips of the axes: a row of their matrix.
  const Mat3<S> r = link_rotation(tree, shape), axes = shape_rotation<S>(shape);
  const auto height = [&](int k) {
    return abs(dot(Vec3<S>{r.m[6], r.m[7], r.m[8]}, column(axes, k)));
  };
  const S x = height(0), y = height(1), z = height(2);
  const Vec3<S> half = constant3<S>(shape.half);
  if (shape.type == ShapeType::kBox)
    p.lowest = p.center.z - (x * half.x + y * half.y + z * half.z);
  else  // capsule; a cylinder lies inside the capsule-like bound radius + half length * |axis|
    p.lowest = p.center.z - (half.x + z * half.z);
  return p;
}

/// Adds the axes, for `support_point`.
template <class S>
STICKSLIP_INLINE void orient(const dynamics::Tree<S>& tree, const GroundShape& shape,
                             PlacedShape<S>& p) {
  if (shape.type != ShapeType::kSphere)
    p.axes = link_rotation(tree, shape) * shape_rotation<S>(shape);
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
    case ShapeType::kBox:
      c = madd(column(placed.axes, 0), half(0, 1), c);
      c = madd(column(placed.axes, 1), half(1, 2), c);
      c = madd(column(placed.axes, 2), half(2, 4), c);
      break;
    case ShapeType::kCapsule:
      c = madd(column(placed.axes, 2), half(2, 1), c);
      break;
    case ShapeType::kCylinder:
      c = rim_point(shape, placed, point);
      break;
    default:
      break;
  }
  c.z = c.z - constant<S>(shape.radius);
  return c;
}

}  // namespace stickslip::collide::inline STICKSLIP_KERNELS
