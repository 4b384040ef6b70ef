// Motions and wrenches about the world's origin, linear part first; matrices (3, 3) and (6, 6) by rows.
#pragma once

#include <array>

#include "math/vec3.hpp"

namespace mbdae {

using Six = std::array<double, 6>;

inline bool is_zero(const Six& x) {
  return !(x[0] != 0 || x[1] != 0 || x[2] != 0 || x[3] != 0 || x[4] != 0 || x[5] != 0);
}

inline void add_cross(const double* a, const double* b, double* __restrict out) {
  out[0] += a[1] * b[2] - a[2] * b[1], out[1] += a[2] * b[0] - a[0] * b[2], out[2] += a[0] * b[1] - a[1] * b[0];
}
inline void symmetric(const double* S, const double* x, double* __restrict out) {  // S x; xx, xy, yy, xz, yz, zz
  out[0] = S[0] * x[0] + S[1] * x[1] + S[3] * x[2];
  out[1] = S[1] * x[0] + S[2] * x[1] + S[4] * x[2];
  out[2] = S[3] * x[0] + S[4] * x[1] + S[5] * x[2];
}

inline void motion_cross(const double* a, const double* b, double* __restrict out) {  // a x b of motions
  cross(a + 3, b, out), add_cross(a, b + 3, out), cross(a + 3, b + 3, out + 3);
}

inline void wrench_cross(const double* d, const double* F, double* __restrict out) {  // d x* F
  cross(d + 3, F, out), cross(d + 3, F + 3, out + 3), add_cross(d, F, out + 3);
}

inline void skew(const double* w, double* out) {  // the cross-product matrix of w
  out[0] = out[4] = out[8] = 0;
  out[1] = -w[2], out[2] = w[1], out[3] = w[2], out[5] = -w[0], out[6] = -w[1], out[7] = w[0];
}

// Rotations by columns: about a unit vector, cosine and sine given, and of a unit quaternion.
inline void rotation_about(const double* e, double c, double s, double* R) {
  const double C = 1 - c;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) R[3 * j + i] = C * e[i] * e[j] + (i == j ? c : 0);
  R[1] += s * e[2], R[2] -= s * e[1], R[3] -= s * e[2], R[5] += s * e[0], R[6] += s * e[1], R[7] -= s * e[0];
}

inline void rotation_of_quaternion(const double* q, double* R) {  // x, y, z, w
  const double x = 2 * q[0], y = 2 * q[1], z = 2 * q[2];
  const double wx = x * q[3], wy = y * q[3], wz = z * q[3], xx = x * q[0], xy = y * q[0], xz = z * q[0];
  const double yy = y * q[1], yz = z * q[1], zz = z * q[2];
  R[0] = 1 - (yy + zz), R[1] = xy + wz, R[2] = xz - wy;
  R[3] = xy - wz, R[4] = 1 - (xx + zz), R[5] = yz + wx;
  R[6] = xz + wy, R[7] = yz - wx, R[8] = 1 - (xx + yy);
}

inline void product(const double* a, const double* b, double* __restrict out) {  // out = a b, (3, 3)
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

inline void skew_product(const double* a, const double* b, double* __restrict out) {  // [a] [b] = b a^T - (a . b) 1
  const double along = dot(a, b);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[3 * i + j] = b[i] * a[j] - (i == j) * along;
}

inline void add_block(double* D, int i, int j, const double* m, double factor) {  // D[i:i+3, j:j+3] += factor m
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l) D[6 * (i + k) + j + l] += factor * m[3 * k + l];
}

}  // namespace mbdae
