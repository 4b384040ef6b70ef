// Norms and products of short arrays; vectors of three components, rotations by rows.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace mbdae {

// The largest |x[i]| / scales[i].
inline double largest_scaled(const double* x, const std::vector<double>& scales) {
  double out = 0;
  for (size_t i = 0; i < scales.size(); ++i) out = std::max(out, std::fabs(x[i]) / scales[i]);
  return out;
}

inline double largest(const double* x, int n) {
  double s = 0;
  for (int i = 0; i < n; ++i) s = std::max(s, std::fabs(x[i]));
  return s;
}

inline double norm(const double* x, int n) {
  double s = 0;
  for (int i = 0; i < n; ++i) s += x[i] * x[i];
  return std::sqrt(s);
}

inline double dot(const double* x, const double* y, int n) {
  double s = 0;
  for (int i = 0; i < n; ++i) s += x[i] * y[i];
  return s;
}

inline double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline double dot6(const double* a, const double* b) { return dot(a, b) + dot(a + 3, b + 3); }

inline bool finite(const double* x, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

inline void cross(const double* a, const double* b, double* __restrict out) {
  out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}

inline void rotate(const double* R, const double* x, double* __restrict out) {
  for (int i = 0; i < 3; ++i) out[i] = R[3 * i] * x[0] + R[3 * i + 1] * x[1] + R[3 * i + 2] * x[2];
}

inline void rotate_by_columns(const double* R, const double* x, double* __restrict out) {
  for (int i = 0; i < 3; ++i) out[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

}  // namespace mbdae
