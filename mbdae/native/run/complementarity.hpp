// Small complementarity problems of multipliers or impulses, with friction (mbdae/mechanism/hybrid/box_lcp.py,
// friction_lcp.py).
#pragma once

#include <cmath>

#include "math/factorizations.hpp"
#include "math/tolerances.hpp"

namespace mbdae {

// A multiplier between bounds; or a tangential multiplier, |x| <= mu x_n, x = d x_n in a sliding contact.
struct Multiplier {
  double lower = -INFINITY, upper = INFINITY;
  int normal = -1;  // index of the normal multiplier, which is not negative; -1: none
  double friction = 0;
  double sliding_ratio = NAN;  // d

  bool bounded() const { return std::isfinite(upper - lower); }
};

// Solve for multipliers x (k,) and rates w = W x + c (k,), which are zero between bounds and directed away from a bound
// at it. Enumerates the states of all multipliers; false if there are more than max_states, or if there is no solution
// or more than one, where c has the rounding error noise (k,). If all multipliers have two bounds and no friction, only
// the rates must be unique.
bool solve_complementarity(const Vector& W, const Vector& c, const Vector& noise,
                           const std::vector<Multiplier>& multipliers, const Tolerances& tolerances, int max_states,
                           Vector& x, Vector& w);

}  // namespace mbdae
