// Plane curves of cams and slots, and contacts with them (mbdae/mechanism/closures/profiles.py).
#pragma once

#include <vector>

#include "math/fields.hpp"

namespace mbdae {

struct Profile {
  bool harmonic = false, closed = true;
  double side = 1;              // orientation of the curve, towards the outside
  std::vector<double> starts;   // of polynomial pieces, and the end; of harmonics 0 and 2 pi
  std::vector<double> coefficients;  // pairs: of piecewise polynomials, highest power first, or of harmonics
  int degree = 0;
  std::vector<double> samples, points;  // s, and pairs c(s)
  int iterations = 0;
  double rounding = 0;   // of the length: last change of an iteration
  double tolerance = 0;  // of |c'|^2 and of the length: smallest curvature of the distance, and overshoot at open ends

  FIELDS(harmonic, closed, side, starts, coefficients, degree, samples, iterations, rounding, tolerance)

  struct Point {
    double s, c[2], d[2], dd[2];  // a point, and its first two derivatives
  };
  Point at(double s) const;
  Point nearest(const double* x) const;  // to a point (2,)
  Point support(const double* n) const;  // farthest along a direction (2,)
};

}  // namespace mbdae
