// Small complementarity problems of multipliers or impulses, with friction (mbdae/mechanism/hybrid/box_lcp.py,
// friction_lcp.py).
#pragma once

#include <cmath>

#include "math/factorizations.hpp"
#include "math/tolerances.hpp"

namespace mbdae {

// A multiplier between its bounds; or a tangential one, |x| <= mu x_n, or d x_n where its contact slides.
struct Multiplier {
  double lower = -INFINITY, upper = INFINITY;
  int normal = -1;  // index of the normal multiplier, which is not negative; -1: none
  double friction = 0;
  double sliding_ratio = NAN;  // d

  bool bounded() const { return std::isfinite(upper - lower); }
};

// Multipliers x (k,) and rates w = W x + c (k,): zero between bounds, and as the bound allows at a bound. All states of all
// multipliers are tried; false where there are more than max_states, or if there is no solution or more than one to
// rounding, which is noise (k,) in c. Of multipliers with two bounds without friction, only the rates need be unique.
bool solve_complementarity(const Vector& W, const Vector& c, const Vector& noise,
                           const std::vector<Multiplier>& multipliers, const Tolerances& limits, int max_states,
                           Vector& x, Vector& w);

}  // namespace mbdae
