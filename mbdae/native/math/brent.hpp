// Roots of functions of one variable.
#pragma once

#include <algorithm>
#include <cmath>

namespace mbdae {

// A zero of f between a and b, where its values fa and fb have opposite signs, by R. P. Brent's method (Algorithms for
// Minimization without Derivatives, 1973, chapter 4): inverse interpolation where it converges, otherwise bisection. b
// is the best so far, c on the other side of the zero.
template <class Function>
double brent(Function&& f, double a, double fa, double b, double fb, double resolution, double relative,
             int iterations) {
  double c = a, fc = fa, move = b - a, before = move;
  for (int k = 0; k < iterations; ++k) {
    if ((fb > 0) == (fc > 0) && (fb < 0) == (fc < 0)) c = a, fc = fa, move = before = b - a;
    if (std::fabs(fc) < std::fabs(fb)) a = b, fa = fb, b = c, fb = fc, c = a, fc = fa;
    const double tolerance = 0.5 * (resolution + relative * std::fabs(b)), to_middle = 0.5 * (c - b);
    if (fb == 0 || std::fabs(to_middle) <= tolerance) break;
    double guess = 0;
    if (std::fabs(before) > tolerance && std::fabs(fb) < std::fabs(fa)) {
      const double ab = (a - b) / (fa - fb), cb = (c - b) / (fc - fb);
      guess = a == c ? -fb * (b - a) / (fb - fa) : -fb * (ab - fa * (cb - ab) / (fc - fa));
    }
    const double longest = std::min(3 * std::fabs(to_middle) - tolerance, std::fabs(before));
    if (guess * to_middle > 0 && 2 * std::fabs(guess) < longest)
      before = move, move = guess;
    else
      before = move = to_middle;
    a = b, fa = fb;
    b += std::fabs(move) > tolerance ? move : std::copysign(tolerance, to_middle);
    fb = f(b);
  }
  return b;
}

}  // namespace mbdae
