// Plane curves of cams and slots, and contacts with them (mbdae/mechanism/closures/profiles.py).
#pragma once

#include <vector>

namespace mbdae {

struct Profile {
  bool harmonic = false, closed = true;
  double side = 1;              // orientation of the curve, towards the outside
  std::vector<double> starts;   // of polynomial pieces, and the end; of harmonics 0 and 2 pi
  std::vector<double> numbers;  // pairs: piecewise polynomials by the highest power first, or coefficients of harmonics
  int degree = 0;
  std::vector<double> samples, points;  // s, and pairs c(s)
  int iterations = 0;
  double rounding = 0, sharp = 0;

  struct Place {
    double s, c[2], d[2], dd[2];  // a point, and its first two derivatives
  };
  Place at(double s) const;
  Place nearest(const double* x) const;  // to a point (2,)
  Place support(const double* n) const;  // farthest along a direction (2,)
};

}  // namespace mbdae
