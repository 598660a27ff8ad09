// Arithmetic on the plain poses of the public API, in double, for building a Model. Kernels have
// their own in src/spatial.
#pragma once
#include <stickslip/model.h>

#include <cmath>

namespace stickslip {

inline Vector3 rotate(const Matrix3& R, const Vector3& v) {
  return {R[0] * v[0] + R[1] * v[1] + R[2] * v[2], R[3] * v[0] + R[4] * v[1] + R[5] * v[2],
          R[6] * v[0] + R[7] * v[1] + R[8] * v[2]};
}

inline Matrix3 multiply(const Matrix3& A, const Matrix3& B) {
  Matrix3 C;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
  return C;
}

inline Matrix3 transpose(const Matrix3& A) {
  return {A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]};
}

/// `p_A = X_AB p_B`.
inline Vector3 transform(const Pose& X_AB, const Vector3& p) {
  const Vector3 r = rotate(X_AB.rotation, p);
  return {r[0] + X_AB.position[0], r[1] + X_AB.position[1], r[2] + X_AB.position[2]};
}

/// `X_AC = X_AB X_BC`.
inline Pose compose(const Pose& X_AB, const Pose& X_BC) {
  return {multiply(X_AB.rotation, X_BC.rotation), transform(X_AB, X_BC.position)};
}

inline double norm(const Vector3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/// Rotation matrix of a unit quaternion.
inline Matrix3 rotation_of_quaternion(double w, double x, double y, double z) {
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

}  // namespace stickslip
