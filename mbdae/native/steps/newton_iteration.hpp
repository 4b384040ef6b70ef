// Newton's method with exact partials, to rounding (`solve_newton` in mbdae/methods/variational.py).
#pragma once

#include <cmath>
#include <utility>

#include "math/factorizations.hpp"
#include "math/fields.hpp"
#include "system/index2.hpp"

namespace mbdae {

struct NewtonIteration {
  int max_iterations = 0;
  double below_rounding = 0, iteration_rounding = 0;   // mbdae/tolerances.py
  double slowest_rate = 0;  // contraction rate above which a small change is rounding error, and the last change

  FIELDS(max_iterations, below_rounding, iteration_rounding, slowest_rate)
};

// correct(dx) sets the Newton correction at x; measure(dx) returns its relative size, and that of rounding errors of
// the configuration.
template <class Correct, class Measure>
void solve_by_newton(const NewtonIteration& it, Counts& counts, Vector& x, Correct&& correct, Measure&& measure) {
  Vector dx(x.size());
  double last = 0;
  for (int k = 0; k < it.max_iterations; ++k) {
    correct(dx);
    for (size_t i = 0; i < x.size(); ++i) x[i] += dx[i];
    counts.newton += 1;
    const auto [size, scale] = measure(dx);
    if (!std::isfinite(size)) break;
    const double rate = last > 0 ? size / last : 1;
    if (rate * size <= it.below_rounding ||
        (rate > it.slowest_rate && size <= it.iteration_rounding * scale))
      return;
    last = size;
  }
  throw FallBackToPython();
}

}  // namespace mbdae
