// Sums over short arrays.
#pragma once

#include <algorithm>
#include <cmath>

namespace mbdae {

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

inline bool finite(const double* x, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

}  // namespace mbdae
