// Plane curves of cams and slots, and their contact points (mbdae/mechanism/closures/profiles.py).
#pragma once

#include <vector>

#include "math/fields.hpp"

namespace mbdae {

struct Profile {
  bool harmonic = false, closed = true;
  double side = 1;                   // sign of the outward normal relative to the orientation of the curve
  std::vector<double> starts;        // first s of each polynomial, and the last s; of harmonics 0 and 2 pi
  std::vector<double> coefficients;  // (x, y) pairs: of polynomials, highest power first, or of harmonics
  int degree = 0;
  std::vector<double> samples, points;  // s, and (x, y) pairs c(s)
  int iterations = 0;
  double rounding = 0;  // largest change of the last iteration, relative to the length
  // smallest second derivative of half the squared distance, relative to |c'|^2; tolerance of s at open ends, relative
  // to the length
  double tolerance = 0;

  FIELDS(harmonic, closed, side, starts, coefficients, degree, samples, iterations, rounding, tolerance)

  struct Point {
    double s, c[2], d[2], dd[2];  // a point, and its first two derivatives
  };
  Point at(double s) const;
  Point nearest(const double* x) const;  // to a point (2,)
  Point support(const double* n) const;  // farthest along a direction (2,)
};

}  // namespace mbdae
