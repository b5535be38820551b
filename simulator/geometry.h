// Small vectors and matrices, no more than the plant needs.
#pragma once

#include <cmath>

namespace setae {
namespace sim {

struct Vec3 {
  double x, y, z;
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 operator-(const Vec3& a) {
  return {-a.x, -a.y, -a.z};
}
inline Vec3 operator*(double s, const Vec3& a) {
  return {s * a.x, s * a.y, s * a.z};
}
inline double dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(const Vec3& a) {
  return std::sqrt(dot(a, a));
}

// A rotation, kept as the turned axes: the columns of its matrix.
struct Mat3 {
  Vec3 ex, ey, ez;
};

inline Mat3 identity() {
  return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
}
inline Vec3 operator*(const Mat3& m, const Vec3& a) {
  return {m.ex.x * a.x + m.ey.x * a.y + m.ez.x * a.z, m.ex.y * a.x + m.ey.y * a.y + m.ez.y * a.z,
          m.ex.z * a.x + m.ey.z * a.y + m.ez.z * a.z};
}
inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {a * b.ex, a * b.ey, a * b.ez};
}
// The transposed matrix times a vector: into the turned frame.
inline Vec3 into(const Mat3& m, const Vec3& a) {
  return {dot(m.ex, a), dot(m.ey, a), dot(m.ez, a)};
}

// Frame D hangs from the arm, z down; its own inverse.
inline Vec3 flip(const Vec3& a) {
  return {a.x, -a.y, -a.z};
}

}  // namespace sim
}  // namespace setae
