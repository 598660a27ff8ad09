// Families made of free rigid bodies: stacks, piles, walls.
#include <algorithm>
#include <cmath>

#include "scenes/constants.h"
#include "scenes/problem_families.h"
#include "scenes/problem_options.h"
#include "scenes/rigid_bodies.h"

namespace stickslip::scenes {
namespace {

/// Cubes of these masses on top of each other, from the ground up.
RigidBodies tower(const std::vector<double>& masses, double size) {
  RigidBodies bodies;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const int box = bodies.add_box(masses[i], {size, size, size}, {0, 0, (i + 0.5) * size});
    bodies.touch_face(box - 1, box, {-size / 2, -size / 2}, {size / 2, size / 2}, i * size);
  }
  return bodies;
}

bool is_heavy(HeavyBoxes heavy, int i, int n) {
  switch (heavy) {
    case HeavyBoxes::kTop:
      return i == n - 1;
    case HeavyBoxes::kBottom:
      return i == 0;
    default:
      return i % 2 == 1;
  }
}

void check_options(const BoxStackOptions& o) {
  check_range("num_boxes", o.num_boxes, 1, 50);
  check_range("mass_ratio", o.mass_ratio, 1.0, kMostMassRatio);
  check_range("size", o.size, 1e-3, 1e3);
  check_noise(o.noise);
  check_friction(o.friction);
  if (!o.push) return;
  for (int k = 0; k < 2; ++k)
    if (!std::isfinite((*o.push)[k]))
      refuse("push[", k, "] is ", (*o.push)[k], " N; it must be finite");
}

}  // namespace

ContactProblem box_stack(std::uint64_t seed, const BoxStackOptions& o) {
  check_options(o);
  Random rng(seed);
  const int drawn_boxes = rng.integer(2, 5), n = o.num_boxes.value_or(drawn_boxes);
  const auto drawn_heavy = static_cast<HeavyBoxes>(rng.below(3)),
             heavy = o.heavy.value_or(drawn_heavy);
  const double friction = draw_friction(o.friction, rng);
  std::vector<double> masses(n);
  for (int i = 0; i < n; ++i) masses[i] = is_heavy(heavy, i, n) ? o.mass_ratio : 1;
  RigidBodies stack = tower(masses, o.size);
  // Up to 1.5 times what the friction of the top box holds: some stick, some slide, some tip.
  const bool pushed = rng.below(2) == 1;
  const double share = rng.uniform(0, 1.5);
  const double force =
      pushed ? share * std::min(friction, kMostPushingFriction) * masses.back() * kGravity : 0;
  double sine, cosine;
  sincos(rng.uniform(0, 6.283185307179586), sine, cosine);
  stack.push(n - 1, o.push.value_or(std::array<double, 2>{force * cosine, force * sine}));
  stack.shake(draw_noise(o.noise, rng), o.size, rng);
  return stack.problem(friction);
}

ContactProblem box_stack(const std::vector<double>& masses, double friction, double push) {
  RigidBodies stack = tower(masses, 0.2);
  stack.push(stack.num_bodies() - 1, {push, 0});
  return stack.problem(friction);
}

namespace {

/// Spheres in layers; touching ones are found from their places in the layer.
class Pile {
 public:
  Pile(int layers, const SpherePileOptions& options) : layers_(layers), options_(options) {}

  void add_layer(int layer, Random& rng) {
    const int side = layers_ - layer, first = bodies_.num_bodies();
    for (int i = 0; i < side * side; ++i) {
      const int x = i % side, y = i / side, sphere = add_sphere(layer, x, y, rng);
      if (layer == 0) {
        const Vector3& center = spheres_[sphere].center;
        bodies_.touch(RigidBodies::kGround, sphere, {center[0], center[1], 0});
      } else {
        for (int k = 0; k < 4; ++k) touch(below_ + (y + k / 2) * (side + 1) + x + k % 2, sphere);
      }
      if (x > 0) touch_if_overlapping(sphere - 1, sphere);
      if (y > 0) touch_if_overlapping(sphere - side, sphere);
    }
    below_ = first;
  }
  RigidBodies& bodies() { return bodies_; }

  static constexpr double kRadius = 0.05;  // [m]

 private:
  struct Sphere {
    double radius;
    Vector3 center;
  };

  int add_sphere(int layer, int x, int y, Random& rng) {
    const double jitter = options_.irregularity * kRadius;
    Sphere s;
    s.radius = kRadius + rng.uniform(-jitter, jitter);
    // A layer lies in the hollows of the one below; the lowest one on the ground.
    const double height = layer == 0 ? s.radius : (1 + std::sqrt(2.0) * layer) * kRadius;
    s.center = {(2 * x + layer) * kRadius, (2 * y + layer) * kRadius, height};
    for (int k = 0; k < (layer == 0 ? 2 : 3); ++k) s.center[k] += rng.uniform(-jitter, jitter);
    spheres_.push_back(s);
    return bodies_.add_sphere(rng.log_uniform(1, options_.mass_ratio), s.radius, s.center);
  }
  /// In the middle of the overlap, or of the gap.
  void touch(int a, int b) {
    const Vector3 apart = spheres_[b].center - spheres_[a].center;
    const double distance = std::sqrt(dot(apart, apart));
    const Vector3 normal = 1 / distance * apart;
    const double reach = (distance + spheres_[a].radius - spheres_[b].radius) / 2;
    bodies_.touch(a, b, spheres_[a].center + reach * normal, normal);
  }
  void touch_if_overlapping(int a, int b) {
    const Vector3 apart = spheres_[b].center - spheres_[a].center;
    const double reach = (spheres_[a].radius + spheres_[b].radius) * (1 + 1e-9);
    if (dot(apart, apart) <= reach * reach) touch(a, b);
  }

  int layers_, below_ = 0;  // first sphere of the layer below
  SpherePileOptions options_;
  RigidBodies bodies_;
  std::vector<Sphere> spheres_;
};

}  // namespace

ContactProblem sphere_pile(std::uint64_t seed, const SpherePileOptions& o) {
  check_range("layers", o.layers, 1, 7);
  check_range("mass_ratio", o.mass_ratio, 1.0, kMostMassRatio);
  check_range("irregularity", o.irregularity, 0.0, 0.2);
  check_noise(o.noise);
  check_friction(o.friction);
  Random rng(seed);
  const int drawn_layers = rng.integer(2, 5), layers = o.layers.value_or(drawn_layers);
  const double friction = draw_friction(o.friction, rng), noise = draw_noise(o.noise, rng);
  Pile pile(layers, o);
  for (int layer = 0; layer < layers; ++layer) pile.add_layer(layer, rng);
  pile.bodies().shake(noise, Pile::kRadius, rng);
  return pile.bodies().problem(friction, Storage::kBlockSparse);
}

ContactProblem brick_wall(std::uint64_t seed, const BrickWallOptions& o) {
  check_range("rows", o.rows, 1, 20);
  check_range("columns", o.columns, 1, 20);
  check_range("mass_ratio", o.mass_ratio, 1.0, kMostMassRatio);
  check_noise(o.noise);
  check_friction(o.friction);
  constexpr double kLength = 0.24, kDepth = 0.12, kHeight = 0.08, kHalf = kLength / 2;  // [m]
  Random rng(seed);
  const int drawn_rows = rng.integer(2, 6), drawn_columns = rng.integer(2, 6);
  const int rows = o.rows.value_or(drawn_rows), columns = o.columns.value_or(drawn_columns);
  const int contacts = 4 * columns * (2 * rows - 1), halves = 2 * columns;
  if (contacts > 1000)
    refuse("rows is ", rows, " and columns is ", columns, ": ", contacts,
           " contacts; 4 columns (2 rows - 1) must be at most 1000");
  const double friction = draw_friction(o.friction, rng), noise = draw_noise(o.noise, rng);
  RigidBodies wall;
  std::vector<int> below(halves), row(halves);  // the brick at each half brick of length
  for (int r = 0; r < rows; ++r) {
    const double z = r * kHeight;
    for (int first = 0, last; first < halves; first = last + 1) {
      // Rows begin with a whole and a half brick in turn.
      last = first % 2 == r % 2 ? std::min(first + 1, halves - 1) : first;
      const double share = (last - first + 1) / 2.0, lo = first * kHalf, hi = (last + 1) * kHalf;
      const int brick =
          wall.add_box(share * rng.log_uniform(1, o.mass_ratio), {share * kLength, kDepth, kHeight},
                       {(lo + hi) / 2, 0, z + kHeight / 2});
      for (int k = first; k <= last; ++k) row[k] = brick;
      if (r == 0) {
        wall.touch_face(RigidBodies::kGround, brick, {lo, -kDepth / 2}, {hi, kDepth / 2}, z);
        continue;
      }
      for (int k = first; k <= last; ++k)
        wall.touch_face(below[k], brick, {k * kHalf, -kDepth / 2}, {(k + 1) * kHalf, kDepth / 2},
                        z);
    }
    below = row;
  }
  wall.shake(noise, kLength, rng);
  return wall.problem(friction, Storage::kBlockSparse);
}

}  // namespace stickslip::scenes
