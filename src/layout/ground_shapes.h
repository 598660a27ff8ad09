// The shapes of a Model that may meet a horizontal plane, as kernels read them
// (collide/ground_shape.h); made once per model.
#pragma once
#include <vector>

#include "collide/ground_shape.h"
#include "layout/tree_layout.h"

namespace stickslip::layout {

/// The shapes of a model that can meet the ground; meshes are left out (`unsupported_shapes` names
/// them).
std::vector<collide::GroundShape> ground_shapes(const Model& model, const TreeLayout& layout);

/// Whether contacts are computed for shapes of this kind.
bool makes_contact(ShapeType type);

/// Indices of shapes that no contact is computed for.
std::vector<int> unsupported_shapes(const Model& model);

int total_points(const std::vector<collide::GroundShape>& shapes);

}  // namespace stickslip::layout
