// Free rigid bodies that touch each other and the ground, as a contact problem.
//
// v = J u, with u of each body the velocity of its center of mass [m/s] and its angular velocity
// [rad/s] in world axes. The velocity of a contact is that of the upper body's point minus that of
// the lower body's, in the contact frame (z along the normal, from the lower to the upper body).
#pragma once
#include <stickslip/contact.h>

#include <array>
#include <vector>

#include "scenes/random.h"
#include "scenes/vector.h"

namespace stickslip::scenes {

/// Form of a problem's Delassus operator.
enum class Storage { kDense, kBlockSparse };

class RigidBodies {
 public:
  static constexpr int kGround = -1;

  /// Adds a body whose principal axes are the world's: mass [kg], moments of inertia [kg m^2],
  /// center [m]. Returns its index.
  int add(double mass, const Vector3& inertia, const Vector3& center);
  /// Adds a box of these side lengths [m].
  int add_box(double mass, const Vector3& size, const Vector3& center);
  /// Adds a solid sphere.
  int add_sphere(double mass, double radius, const Vector3& center);

  /// Adds a contact at a point [m]. `normal` has length 1.
  void touch(int lower, int upper, const Vector3& point, const Vector3& normal = {0, 0, 1});
  /// Adds the four corners of the face that two axis-aligned boxes share at height z: where
  /// [lo, hi] in x and y is their overlap.
  void touch_face(int lower, int upper, const std::array<double, 2>& lo,
                  const std::array<double, 2>& hi, double z);

  /// A horizontal force [N] on a body during the step.
  void push(int body, const std::array<double, 2>& force);
  /// Adds random velocities, each with standard deviation `speed` [m/s], turning ones `speed /
  /// length` [rad/s].
  void shake(double speed, double length, Random& rng);

  int num_bodies() const { return static_cast<int>(bodies_.size()); }
  int num_contacts() const { return static_cast<int>(contacts_.size()); }

  /// The problem of one step of kProblemStep: free velocities after gravity and pushes, the same
  /// friction everywhere.
  ContactProblem problem(double friction, Storage storage = Storage::kDense) const;

 private:
  struct Body {
    double mass;
    Vector3 inertia, center, velocity, spin, force;
  };
  struct Contact {
    int body[2];  // lower, upper
    Vector3 point;
    Matrix3 axes;  // rows: two tangents, the normal
  };
  // Three rows of J, of one contact and one of its bodies.
  using Rows = std::array<std::array<double, 6>, 3>;
  Rows rows(const Contact& contact, int side) const;

  std::vector<Body> bodies_;
  std::vector<Contact> contacts_;
};

}  // namespace stickslip::scenes
