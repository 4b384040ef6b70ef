#include "signals.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

double Signal::at(double t, int k) const {
  switch (kind) {
    case constant:
      return k ? 0.0 : a[0];
    case harmonic: {  // amplitude, omega, phase, offset
      const double value = a[0] * std::sin(a[1] * t + a[2] + k * M_PI_2);
      return k ? value * (k == 1 ? a[1] : a[1] * a[1]) : value + a[3];
    }
    case polynomial: {
      double value = 0;
      for (int i = static_cast<int>(a.size()) - 1; i >= k; --i) {
        double c = a[i];
        for (int j = 0; j < k; ++j) c *= i - j;
        value = value * t + c;
      }
      return value;
    }
    case pieces: {
      if (!std::isfinite(t)) throw Trouble();
      const int n = static_cast<int>(b.size()) - 1;
      int i = static_cast<int>(std::upper_bound(b.begin(), b.end(), t) - b.begin()) - 1;
      i = std::max(0, std::min(i, n - 1));
      const double x = t - b[i], *c = &a[static_cast<size_t>(i) * (degree + 1)];
      double value = 0;
      for (int p = degree; p >= k; --p) {
        double f = c[degree - p];
        for (int j = 0; j < k; ++j) f *= p - j;
        value = value * x + f;
      }
      return value;
    }
    case steps: {
      if (k) return 0.0;
      const auto i = std::upper_bound(b.begin(), b.end(), t) - b.begin();
      return a[std::max<std::ptrdiff_t>(0, i - 1)];
    }
    case python:
      return call(t, k);
  }
  return 0.0;
}

}  // namespace mbdae
