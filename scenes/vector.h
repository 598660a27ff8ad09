// The few operations on Vector3 and Matrix3 (row-major) that the scenes need.
#pragma once
#include <stickslip/model.h>

#include "lane/math.h"

namespace stickslip::scenes {

inline Vector3 operator+(const Vector3& a, const Vector3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Vector3 operator-(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Vector3 operator*(double s, const Vector3& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Vector3 operator*(const Matrix3& m, const Vector3& a) {
  return {m[0] * a[0] + m[1] * a[1] + m[2] * a[2], m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
          m[6] * a[0] + m[7] * a[1] + m[8] * a[2]};
}
inline Vector3 transposed_times(const Matrix3& m, const Vector3& a) {
  return {m[0] * a[0] + m[3] * a[1] + m[6] * a[2], m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
          m[2] * a[0] + m[5] * a[1] + m[8] * a[2]};
}
inline Matrix3 operator*(const Matrix3& a, const Matrix3& b) {
  Matrix3 r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      r[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  return r;
}
inline Vector3 column(const Matrix3& m, int j) { return {m[j], m[3 + j], m[6 + j]}; }
/// A turn by `angle` [rad] about coordinate axis 0, 1 or 2.
inline Matrix3 rotation(int axis, double angle) {
  double sine, cosine;
  sincos(angle, sine, cosine);
  Matrix3 r{};
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  r[4 * axis] = 1, r[4 * i] = r[4 * j] = cosine;
  r[3 * i + j] = -sine, r[3 * j + i] = sine;
  return r;
}

}  // namespace stickslip::scenes
