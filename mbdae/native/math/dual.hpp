// Dual numbers (forward-mode automatic differentiation): a value and its derivatives in N directions.
#pragma once

#include <algorithm>
#include <cmath>

namespace mbdae {

template <int N>
struct Dual {
  double x = 0, d[N] = {};

  Dual() = default;
  Dual(double value) : x(value) {}

  // f(a) and f(a, b), from the value and the partial derivatives of f
  friend Dual chain(const Dual& a, double value, double df_da) {
    Dual out(value);
    for (int i = 0; i < N; ++i) out.d[i] = df_da * a.d[i];
    return out;
  }
  friend Dual chain(const Dual& a, const Dual& b, double value, double df_da, double df_db) {
    Dual out(value);
    for (int i = 0; i < N; ++i) out.d[i] = df_da * a.d[i] + df_db * b.d[i];
    return out;
  }

  friend Dual operator-(const Dual& a) { return chain(a, -a.x, -1); }
  friend Dual operator+(const Dual& a, const Dual& b) { return chain(a, b, a.x + b.x, 1, 1); }
  friend Dual operator-(const Dual& a, const Dual& b) { return chain(a, b, a.x - b.x, 1, -1); }
  friend Dual operator*(const Dual& a, const Dual& b) { return chain(a, b, a.x * b.x, b.x, a.x); }
  friend Dual operator/(const Dual& a, const Dual& b) { return chain(a, b, a.x / b.x, 1 / b.x, -a.x / (b.x * b.x)); }
  friend Dual operator+(const Dual& a, double b) { return chain(a, a.x + b, 1); }
  friend Dual operator+(double a, const Dual& b) { return chain(b, a + b.x, 1); }
  friend Dual operator-(const Dual& a, double b) { return chain(a, a.x - b, 1); }
  friend Dual operator-(double a, const Dual& b) { return chain(b, a - b.x, -1); }
  friend Dual operator*(const Dual& a, double b) { return chain(a, a.x * b, b); }
  friend Dual operator*(double a, const Dual& b) { return chain(b, a * b.x, a); }
  friend Dual operator/(const Dual& a, double b) { return chain(a, a.x / b, 1 / b); }
  friend Dual operator/(double a, const Dual& b) { return chain(b, a / b.x, -a / (b.x * b.x)); }

  friend Dual abs(const Dual& a) { return a.x < 0 ? -a : a; }
  friend Dual sqrt(const Dual& a) { return chain(a, std::sqrt(a.x), 0.5 / std::sqrt(a.x)); }
  friend Dual sin(const Dual& a) { return chain(a, std::sin(a.x), std::cos(a.x)); }
  friend Dual cos(const Dual& a) { return chain(a, std::cos(a.x), -std::sin(a.x)); }
  friend Dual exp(const Dual& a) { return chain(a, std::exp(a.x), std::exp(a.x)); }
  friend Dual tanh(const Dual& a) {
    const double y = std::tanh(a.x);
    return chain(a, y, 1 - y * y);
  }
  friend Dual atan2(const Dual& a, const Dual& b) {
    const double square = a.x * a.x + b.x * b.x;
    return chain(a, b, std::atan2(a.x, b.x), b.x / square, -a.x / square);
  }
};

using std::abs, std::atan2, std::cos, std::exp, std::sin, std::sqrt, std::tanh;

inline double value(double a) { return a; }
template <int N>
double value(const Dual<N>& a) {
  return a.x;
}

// The largest magnitude of a value and its derivatives.
inline double magnitude(double a) { return std::fabs(a); }
template <int N>
double magnitude(const Dual<N>& a) {
  double out = std::fabs(a.x);
  for (double d : a.d) out = std::max(out, std::fabs(d));
  return out;
}

template <class S, class T>
using Common = decltype(S() * T());

}  // namespace mbdae
