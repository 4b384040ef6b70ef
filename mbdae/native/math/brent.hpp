// Roots of functions of one variable.
#pragma once

#include <algorithm>
#include <cmath>

namespace mbdae {

// A zero of f between a and b, where its values fa and fb have opposite signs, by R. P. Brent's method (Algorithms for
// Minimization without Derivatives, 1973, chapter 4): inverse interpolation where it converges, otherwise bisection. b
// is the best estimate so far; the zero lies between b and c.
template <class Function>
double brent(Function&& f, double a, double fa, double b, double fb, double resolution, double relative,
             int iterations) {
  double c = a, fc = fa, step = b - a, previous_step = step;
  for (int k = 0; k < iterations; ++k) {
    if ((fb > 0) == (fc > 0) && (fb < 0) == (fc < 0)) c = a, fc = fa, step = previous_step = b - a;
    if (std::fabs(fc) < std::fabs(fb)) a = b, fa = fb, b = c, fb = fc, c = a, fc = fa;
    const double tolerance = 0.5 * (resolution + relative * std::fabs(b)), half_interval = 0.5 * (c - b);
    if (fb == 0 || std::fabs(half_interval) <= tolerance) break;
    double interpolated = 0;
    if (std::fabs(previous_step) > tolerance && std::fabs(fb) < std::fabs(fa)) {
      const double ab = (a - b) / (fa - fb), cb = (c - b) / (fc - fb);
      interpolated = a == c ? -fb * (b - a) / (fb - fa) : -fb * (ab - fa * (cb - ab) / (fc - fa));
    }
    const double largest_step = std::min(3 * std::fabs(half_interval) - tolerance, std::fabs(previous_step));
    if (interpolated * half_interval > 0 && 2 * std::fabs(interpolated) < largest_step)
      previous_step = step, step = interpolated;
    else
      previous_step = step = half_interval;
    a = b, fa = fb;
    b += std::fabs(step) > tolerance ? step : std::copysign(tolerance, half_interval);
    fb = f(b);
  }
  return b;
}

}  // namespace mbdae
