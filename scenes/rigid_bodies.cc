#include "scenes/rigid_bodies.h"

#include <cmath>

#include "scenes/block_rows.h"
#include "scenes/constants.h"

namespace stickslip::scenes {

int RigidBodies::add(double mass, const Vector3& inertia, const Vector3& center) {
  bodies_.push_back({mass, inertia, center, {}, {}, {}});
  return num_bodies() - 1;
}

int RigidBodies::add_box(double mass, const Vector3& s, const Vector3& center) {
  const double k = mass / 12;
  return add(mass,
             {k * (s[1] * s[1] + s[2] * s[2]), k * (s[0] * s[0] + s[2] * s[2]),
              k * (s[0] * s[0] + s[1] * s[1])},
             center);
}

int RigidBodies::add_sphere(double mass, double radius, const Vector3& center) {
  const double k = 0.4 * mass * radius * radius;
  return add(mass, {k, k, k}, center);
}

void RigidBodies::touch(int lower, int upper, const Vector3& point, const Vector3& normal) {
  // The first tangent is the world axis that is farthest from the normal, made perpendicular to it.
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (std::fabs(normal[k]) < std::fabs(normal[axis])) axis = k;
  Vector3 x{};
  x[axis] = 1;
  x = x - dot(x, normal) * normal;
  x = 1 / std::sqrt(dot(x, x)) * x;
  const Vector3 y = cross(normal, x);
  contacts_.push_back({{lower, upper},
                       point,
                       {x[0], x[1], x[2], y[0], y[1], y[2], normal[0], normal[1], normal[2]}});
}

void RigidBodies::touch_face(int lower, int upper, const std::array<double, 2>& lo,
                             const std::array<double, 2>& hi, double z) {
  for (int corner = 0; corner < 4; ++corner)
    touch(lower, upper, {corner & 1 ? hi[0] : lo[0], corner & 2 ? hi[1] : lo[1], z});
}

void RigidBodies::push(int body, const std::array<double, 2>& force) {
  bodies_[body].force = bodies_[body].force + Vector3{force[0], force[1], 0};
}

void RigidBodies::shake(double speed, double length, Random& rng) {
  for (Body& b : bodies_) {
    for (double& v : b.velocity) v += speed * rng.normal();
    for (double& w : b.spin) w += speed / length * rng.normal();
  }
}

RigidBodies::Rows RigidBodies::rows(const Contact& contact, int side) const {
  const Vector3 arm = contact.point - bodies_[contact.body[side]].center;
  const double sign = side == 0 ? -1 : 1;
  Rows rows;
  for (int r = 0; r < 3; ++r) {
    // t . (v + w x arm) = t . v + (arm x t) . w
    const Vector3 t{contact.axes[3 * r], contact.axes[3 * r + 1], contact.axes[3 * r + 2]},
        turn = cross(arm, t);
    for (int k = 0; k < 3; ++k) rows[r][k] = sign * t[k], rows[r][3 + k] = sign * turn[k];
  }
  return rows;
}

ContactProblem RigidBodies::problem(double friction, Storage storage) const {
  struct Part {
    int contact;
    Rows y;  // J M^-1/2
  };
  std::vector<std::vector<Part>> of_body(bodies_.size());
  std::vector<double> free_velocity(3 * contacts_.size());
  for (int i = 0; i < num_contacts(); ++i)
    for (int side = 0; side < 2; ++side) {
      const int index = contacts_[i].body[side];
      if (index == kGround) continue;
      const Body& b = bodies_[index];
      Rows y = rows(contacts_[i], side);
      for (int r = 0; r < 3; ++r)
        for (int k = 0; k < 3; ++k) {
          const double gravity = k == 2 ? kGravity : 0;
          const double v = b.velocity[k] + kProblemStep * (b.force[k] / b.mass - gravity);
          free_velocity[3 * i + r] += y[r][k] * v + y[r][3 + k] * b.spin[k];
          y[r][k] /= std::sqrt(b.mass), y[r][3 + k] /= std::sqrt(b.inertia[k]);
        }
      of_body[index].push_back({i, y});
    }
  // G_ij = sum of Y_i Y_j^T over the bodies that both contacts touch
  BlockRows delassus(num_contacts());
  for (const auto& parts : of_body)
    for (const Part& a : parts)
      for (const Part& b : parts) {
        std::array<double, 9>& block = delassus.at(a.contact, b.contact);
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s)
            for (int k = 0; k < 6; ++k) block[3 * r + s] += a.y[r][k] * b.y[s][k];
      }
  std::vector<double> mu(contacts_.size(), friction);
  return storage == Storage::kDense
             ? delassus.dense_problem(std::move(free_velocity), std::move(mu))
             : delassus.sparse_problem(std::move(free_velocity), std::move(mu));
}

}  // namespace stickslip::scenes
