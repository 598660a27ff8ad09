// A collision shape as the kernels see it: its place on a link, its size, its support points.
//
// Each shape offers a fixed list of support points: a sphere one, a capsule two (spheres at its
// ends), a box its eight corners, a cylinder four rim points per cap (lowest, highest and the two
// between). Where they are: support_points.h.
#pragma once
#include "dynamics/branches.h"

// Plain data, the same for every instruction set.
namespace stickslip::collide {

enum class GroundShapeType { kSphere, kBox, kCapsule, kCylinder };

/// A shape in its turned link frame.
struct GroundShape {
  dynamics::LinkIndex link;
  int body, shape;  // of the model
  GroundShapeType type;
  double center[3];
  double axes[9];          // row-major; columns: shape axes
  double half[3];          // box: half sides; capsule, cylinder: {radius, radius, half length}
  double radius;           // of the support points; 0 for box and cylinder
  double bounding_radius;  // of all of the shape about its center
  int first_point, num_points;
};

}  // namespace stickslip::collide
