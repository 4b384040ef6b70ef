// Functions of time with two derivatives, as mbdae/mechanism/signals.py defines them.
#pragma once

#include <functional>
#include <vector>

namespace mbdae {

// What the core cannot go on with; the Python step that is taken instead finds the words for it.
struct Trouble {};

struct Signal {
  enum Kind { constant, harmonic, polynomial, pieces, steps, python } kind = constant;
  std::vector<double> a, b;  // numbers; breakpoints, of pieces and steps; coefficients by pieces, highest power first
  int degree = 0;            // of pieces
  std::function<double(double, int)> call;

  double at(double t, int k = 0) const;  // the k-th derivative
};

}  // namespace mbdae
