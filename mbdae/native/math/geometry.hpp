// Vectors, rotations (by rows), velocities and wrenches of frames over any scalar.
#pragma once

#include "math/dual.hpp"

namespace mbdae {

template <class S>
struct Vec3 {
  S x[3];

  Vec3() = default;
  Vec3(const S& a, const S& b, const S& c) : x{a, b, c} {}
  template <class T>
  explicit Vec3(const T* from) : x{from[0], from[1], from[2]} {}
  template <class T>
  Vec3(const Vec3<T>& v) : Vec3(v.x) {}
  const S& operator[](int i) const { return x[i]; }
  S& operator[](int i) { return x[i]; }
};

template <class S, class T>
Vec3<Common<S, T>> operator+(const Vec3<S>& a, const Vec3<T>& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
template <class S, class T>
Vec3<Common<S, T>> operator-(const Vec3<S>& a, const Vec3<T>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class S, class T>
Vec3<Common<S, T>> operator*(const S& a, const Vec3<T>& b) {
  return {a * b[0], a * b[1], a * b[2]};
}
template <class S, class T>
Common<S, T> dot(const Vec3<S>& a, const Vec3<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
template <class S, class T>
Vec3<Common<S, T>> cross(const Vec3<S>& a, const Vec3<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <class T>
Vec3<T> scaled(const double* factors, const Vec3<T>& a) {  // component by component
  return {factors[0] * a[0], factors[1] * a[1], factors[2] * a[2]};
}

template <class S>
struct Rotation {
  S x[9];

  Rotation() = default;
  explicit Rotation(const double* from) { std::copy(from, from + 9, x); }
};

template <class S, class T>
Vec3<Common<S, T>> operator*(const Rotation<S>& R, const Vec3<T>& a) {
  const S* x = R.x;
  return {x[0] * a[0] + x[1] * a[1] + x[2] * a[2], x[3] * a[0] + x[4] * a[1] + x[5] * a[2],
          x[6] * a[0] + x[7] * a[1] + x[8] * a[2]};
}
template <class S, class T>
Vec3<Common<S, T>> transposed(const Rotation<S>& R, const Vec3<T>& a) {  // R^T a
  const S* x = R.x;
  return {x[0] * a[0] + x[3] * a[1] + x[6] * a[2], x[1] * a[0] + x[4] * a[1] + x[7] * a[2],
          x[2] * a[0] + x[5] * a[1] + x[8] * a[2]};
}
template <class S, class T>
Rotation<Common<S, T>> transposed(const Rotation<S>& A, const Rotation<T>& B) {  // A^T B
  Rotation<Common<S, T>> out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      out.x[3 * i + j] = A.x[i] * B.x[j] + A.x[3 + i] * B.x[3 + j] + A.x[6 + i] * B.x[6 + j];
  return out;
}

template <class S>
Vec3<S> column(const Rotation<S>& R, int k) {
  return {R.x[k], R.x[3 + k], R.x[6 + k]};
}

template <class S>
struct Velocity {  // spatial, about the world's origin
  Vec3<S> linear, angular;

  template <class T>
  Vec3<Common<S, T>> at(const Vec3<T>& p) const {
    return linear + cross(angular, p);
  }
};

template <class S>
struct Wrench {  // about the world's origin
  Vec3<S> force, moment;
};

template <class S, class T>
Wrench<Common<S, T>> wrench_at(const Vec3<S>& p, const Vec3<T>& force) {  // wrench of a force through p
  return {force, cross(p, force)};
}
template <class S, class T, class U>
Wrench<Common<S, T>> wrench_at(const Vec3<S>& p, const Vec3<T>& force, const Vec3<U>& moment) {
  return {force, cross(p, force) + moment};
}

}  // namespace mbdae
