// Collision shapes of a robot that may meet a horizontal plane, made once per model.
//
// Each shape offers a fixed list of support points: a sphere one, a capsule two (spheres at its
// ends), a box its eight corners, a cylinder four rim points per cap (lowest, highest and the two
// between). Where they are: support_points.h.
#pragma once
#include <stickslip/model.h>

#include <vector>

#include "dynamics/tree_layout.h"

namespace stickslip::collide {

/// A shape in its turned link frame. Plain data, the same for every instruction set.
struct GroundShape {
  dynamics::LinkIndex link;
  int body, shape;
  ShapeType type;
  double center[3];
  double axes[9];          // row-major; columns: shape axes
  double half[3];          // box: half sides; capsule, cylinder: {radius, radius, half length}
  double radius;           // of the support points; 0 for box and cylinder
  double bounding_radius;  // of all of the shape about its center
  int first_point, num_points;
};

/// The shapes of a model that can meet the ground; meshes are left out (`unsupported_shapes` names
/// them).
std::vector<GroundShape> ground_shapes(const Model& model, const dynamics::TreeLayout& layout);

/// Indices of shapes that no contact is computed for.
std::vector<int> unsupported_shapes(const Model& model);

int total_points(const std::vector<GroundShape>& shapes);

}  // namespace stickslip::collide
