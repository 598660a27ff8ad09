// Collision shapes of a robot against a horizontal plane: which points may touch, and how deep they
// are.
//
// Each shape offers a fixed list of support points: a sphere one, a capsule two (spheres at its
// ends), a box its eight corners, a cylinder four rim points per cap (lowest, highest and the two
// between). A support point is a center and a radius; it touches the plane at the point straight
// below the center.
#pragma once
#include <stickslip/model.h>

#include <vector>

#include "dynamics/kinematics.h"
#include "dynamics/tree_layout.h"

namespace stickslip::collide {

/// A shape in its turned link frame.
struct GroundShape {
  dynamics::LinkIndex link;
  int body, shape;
  ShapeType type;
  Vec3<double> center;
  Mat3<double> axes;       // columns: shape axes
  Vec3<double> half;       // box: half sides; capsule, cylinder: {radius, radius, half length}
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

/// A shape placed in the world: center relative to the base origin, and axes.
struct PlacedShape {
  Vec3<double> center;
  Mat3<double> axes;
  double lowest;  // height of its lowest point above the base origin, never too high
};

PlacedShape place(const dynamics::Tree<double>& tree, const GroundShape& shape);

/// Where support point `point` (0 .. num_points - 1) of a placed shape touches first: its lowest
/// point, relative to the base origin, world axes.
Vec3<double> support_point(const GroundShape& shape, const PlacedShape& placed, int point);

}  // namespace stickslip::collide
