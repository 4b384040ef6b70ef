// Evaluation of profiles, and Newton's method for their nearest and farthest points.
#include "mechanism/profiles.hpp"

#include <algorithm>
#include <cmath>

#include "mechanism/time_functions.hpp"
#include "math/vec3.hpp"

namespace mbdae {

Profile::Point Profile::at(double s) const {
  const double length = starts.back() - starts[0];
  if (closed) s -= length * std::floor((s - starts[0]) / length);
  if (!std::isfinite(s)) throw FallBackToPython();
  Point out{s, {0, 0}, {0, 0}, {0, 0}};
  if (harmonic) {
    for (int j = 0; j < 2; ++j) out.c[j] = coefficients[j];
    for (size_t i = 1; 2 * i < coefficients.size(); ++i) {
      const double k = static_cast<double>((i + 1) / 2), wave[2] = {std::cos(k * s), std::sin(k * s)};
      const int is_sine = i % 2 == 0;
      for (int j = 0; j < 2; ++j) {
        const double a = coefficients[2 * i + j];
        out.c[j] += wave[is_sine] * a, out.d[j] += (is_sine ? k : -k) * wave[1 - is_sine] * a,
            out.dd[j] -= k * k * wave[is_sine] * a;
      }
    }
    return out;
  }
  const auto next = std::upper_bound(starts.begin(), starts.end() - 1, s) - starts.begin();
  const size_t i = static_cast<size_t>(std::max<std::ptrdiff_t>(0, next - 1));
  const double x = s - starts[i], *row = &coefficients[2 * i * (static_cast<size_t>(degree) + 1)];
  for (int p = 0; p <= degree; ++p)
    for (int j = 0; j < 2; ++j) {
      out.dd[j] = out.dd[j] * x + 2 * out.d[j], out.d[j] = out.d[j] * x + out.c[j];
      out.c[j] = out.c[j] * x + row[2 * p + j];
    }
  return out;
}

Profile::Point Profile::nearest(const double* x) const {
  size_t start = 0;
  double smallest = INFINITY;
  for (size_t i = 0; i < samples.size(); ++i) {
    const double a = points[2 * i] - x[0], b = points[2 * i + 1] - x[1], square = a * a + b * b;
    if (square < smallest) smallest = square, start = i;
  }
  const double length = starts.back() - starts[0];
  double s = samples[start], size = 0, derivative = 0, offset[2];
  auto is_regular = [&](const Point& p) {
    for (int j = 0; j < 2; ++j) offset[j] = x[j] - p.c[j];
    size = dot(p.d, p.d, 2), derivative = size - dot(offset, p.dd, 2);
    return derivative > tolerance * size;
  };
  for (int k = 0; k < iterations; ++k) {
    const Point p = at(s);
    const double step = is_regular(p) ? dot(offset, p.d, 2) / derivative : 0.0;
    s += step;
    if (std::fabs(step) <= rounding * length) break;
  }
  const Point out = at(s);
  if (!is_regular(out)) throw FallBackToPython();
  const double fraction = (out.s - starts[0]) / length;
  if (!closed && !(-tolerance <= fraction && fraction <= 1 + tolerance)) throw FallBackToPython();
  return out;
}

Profile::Point Profile::support(const double* n) const {
  size_t start = 0;
  double farthest = -INFINITY;
  for (size_t i = 0; i < samples.size(); ++i) {
    const double distance = dot(&points[2 * i], n, 2);
    if (distance > farthest) farthest = distance, start = i;
  }
  const double length = starts.back() - starts[0];
  double s = samples[start];
  for (int k = 0; k < iterations; ++k) {
    const Point p = at(s);
    const double second = dot(p.dd, n, 2), step = second < 0 ? dot(p.d, n, 2) / second : 0.0;
    s -= step;
    if (std::fabs(step) <= rounding * length) break;
  }
  const Point out = at(s);
  if (!(dot(out.dd, n, 2) < 0)) throw FallBackToPython();
  return out;
}

}  // namespace mbdae
