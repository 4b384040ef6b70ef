// Newton's method with exact partials, to rounding (`solved` in mbdae/methods/variational.py).
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
  double slowest_rate = 0;  // ratio of changes above which one near rounding is the last

  FIELDS(max_iterations, below_rounding, iteration_rounding, slowest_rate)
};

// correct(dx): changes of the unknowns at x. measure(dx): their relative size, and that of the configuration.
template <class Correct, class Measure>
void solve_by_newton(const NewtonIteration& it, Counts& counts, Numbers& x, Correct&& correct, Measure&& measure) {
  Numbers dx(x.size());
  double last = 0;
  for (int k = 0; k < it.max_iterations; ++k) {
    correct(dx);
    for (size_t i = 0; i < x.size(); ++i) x[i] += dx[i];
    counts.newton += 1;
    const std::pair<double, double> found = measure(dx);
    const double size = found.first;
    if (!std::isfinite(size)) break;
    const double rate = last > 0 ? size / last : 1;
    if (rate * size <= it.below_rounding ||
        (rate > it.slowest_rate && size <= it.iteration_rounding * found.second))
      return;
    last = size;
  }
  throw FallBackToPython();
}

}  // namespace mbdae
