// Interpolating polynomials (Hermite cubic, divided differences), their extrema and zeros.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace mbdae {

// The cubic with values f and derivatives m at 0 and 1: c[3] + c[2] x + c[1] x^2 + c[0] x^3.
struct Cubic {
  Cubic(double f0, double f1, double m0, double m1)
      : c{2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1, m0, f0} {}

  double value(double x) const { return c[3] + x * (c[2] + x * (c[1] + x * c[0])); }

  // Whether it has a minimum in (0, 1), provided that its derivative is positive at 1.
  bool has_minimum() const {
    return c[2] < 0 || (c[1] < 0 && c[0] > 0 && c[1] * c[1] > 3 * c[0] * c[2] && -c[1] < 3 * c[0]);
  }
  double minimum() const {
    const double root = std::sqrt(std::max(0.0, c[1] * c[1] - 3 * c[0] * c[2]));
    return value(c[1] >= 0 ? -c[2] / (c[1] + root) : (root - c[1]) / (3 * c[0]));
  }

  // A point before the minimum where it falls.
  double falling_point() const { return c[2] < 0 ? 0 : -c[1] / (3 * c[0]); }

  // The first zero in (0, 1), of the cubic divided by x if it is zero at 0; 1 if there is none.
  double first_zero() const {
    const bool starts_at_zero = c[3] == 0;
    const auto f = [&](double x) { return starts_at_zero ? c[2] + x * (c[1] + x * c[0]) : value(x); };
    // extrema: the function is monotonic between them
    const double a = starts_at_zero ? 0 : 3 * c[0], b = starts_at_zero ? 2 * c[0] : 2 * c[1];
    const double d = starts_at_zero ? c[1] : c[2];
    double bounds[3] = {1, 1, 1};
    if (a == 0) {
      bounds[0] = -d / b;
    } else if (b * b >= 4 * a * d) {
      const double sum = -0.5 * (b + std::copysign(std::sqrt(b * b - 4 * a * d), b));
      bounds[0] = sum / a, bounds[1] = d / sum;
    }
    for (double& x : bounds)
      if (!(0 < x && x < 1)) x = 1;
    std::sort(bounds, bounds + 3);
    double low = 0;
    for (double high : bounds) {
      if (f(low) > 0 && !(f(high) > 0)) {
        for (double x = 0.5 * (low + high); low < x && x < high; x = 0.5 * (low + high)) (f(x) > 0 ? low : high) = x;
        return low;
      }
      low = high;
    }
    return 1;
  }

  const double c[4];
};

// A change of the sign of f between low and high, by bisection.
template <class Function>
double bisect(Function&& f, double low, double high) {
  const bool positive = f(low) > 0;
  for (double x = 0.5 * (low + high); low < x && x < high; x = 0.5 * (low + high))
    ((f(x) > 0) == positive ? low : high) = x;
  return low;
}

// The root of a polynomial near x by Newton's method; f returns its value and derivative.
template <class Function>
double newton_root(Function&& f, double x) {
  for (int k = 0; k < 3; ++k) {
    const auto [value, derivative] = f(x);
    x -= value / derivative;
  }
  return x;
}

// The polynomial through points, with given derivatives at some of them, by divided differences.
class Interpolant {
 public:
  Interpolant() = default;
  Interpolant(const double* values, int n) {  // at 0, 1, 2, ...
    for (int k = 0; k < n; ++k) add(k, values[k]);
  }

  void add(double x, double f) { append(x, f, 0); }
  void add(double x, double f, double derivative) { append(x, f, 0), append(x, f, derivative); }

  std::pair<double, double> evaluate(double x) const {  // value and derivative
    double f = 0, df = 0;
    for (size_t n = nodes_.size(); n-- > 0;) df = f + (x - nodes_[n]) * df, f = d_[n] + (x - nodes_[n]) * f;
    return {f, df};
  }
  double value(double x) const { return evaluate(x).first; }
  double derivative(double x) const { return evaluate(x).second; }

  std::vector<double> extrema(double first, double last) const {
    std::vector<double> out;
    const auto rate = [&](double x) { return derivative(x); };
    for (double x = first; x < last; x += SAMPLING_INTERVAL) {
      const double high = std::min(x + SAMPLING_INTERVAL, last);
      if ((rate(x) > 0) != (rate(high) > 0)) out.push_back(bisect(rate, x, high));
    }
    return out;
  }

  double first_zero(double last) const {  // where it becomes negative, after 0; 0 if it does not
    for (double low = 0; low < last; low += SAMPLING_INTERVAL) {
      const double high = std::min(low + SAMPLING_INTERVAL, last);
      if (value(low) > 0 && !(value(high) > 0)) return bisect([&](double x) { return value(x); }, low, high);
    }
    return 0;
  }

  double root(double x) const {
    return newton_root([&](double at) { return evaluate(at); }, x);
  }

 private:
  static constexpr double SAMPLING_INTERVAL = 1.0 / 8;  // between the points tested for sign changes

  void append(double x, double f, double derivative) {  // derivative: used for the second of two equal nodes
    double difference = f;
    for (size_t n = nodes_.size(), k = n; k > 0; --k) {
      const double previous = std::exchange(last_[n - k], difference), width = x - nodes_[k - 1];
      difference = width == 0 ? derivative : (difference - previous) / width;
    }
    nodes_.push_back(x), last_.push_back(difference), d_.push_back(difference);
  }

  std::vector<double> nodes_, d_, last_;  // last_: differences that end at the last node
};

}  // namespace mbdae
