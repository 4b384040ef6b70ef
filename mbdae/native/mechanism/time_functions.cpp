// Evaluation of functions of time and their derivatives.
#include "mechanism/time_functions.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

double TimeFunction::at(double t, int k) const {
  if (kind == python) return call(t, k);
  if (kind == harmonic) {  // amplitude, omega, phase, offset
    double value = a[0] * std::sin(a[1] * t + a[2] + k * M_PI_2);
    for (int j = 0; j < k; ++j) value *= a[1];
    return k ? value : value + a[3];
  }
  size_t i = 0;
  double periods = 0;
  if (period > 0) {
    if (!std::isfinite(t)) throw FallBackToPython();
    periods = std::floor((t - b[0]) / period), t -= periods * period;
  }
  if (b.size() > 1) {
    if (!std::isfinite(t)) throw FallBackToPython();
    const auto next = std::upper_bound(b.begin(), b.end(), t) - b.begin();
    i = static_cast<size_t>(std::max<std::ptrdiff_t>(0, next - 1));
  }
  if (k > degree) return 0.0;
  const double x = t - b[i], *c = &a[i * (static_cast<size_t>(degree) + 1)];
  auto coefficient = [&](int p) {  // coefficient of the k-th derivative, from that of the p-th power
    double f = c[degree - p];
    for (int j = 0; j < k; ++j) f *= p - j;
    return f;
  };
  double value = coefficient(degree);
  for (int p = degree - 1; p >= k; --p) value = value * x + coefficient(p);
  return k ? value : value + periods * rise;
}

}  // namespace mbdae
