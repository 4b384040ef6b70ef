// Functions of time with two derivatives, as mbdae/mechanism/time_functions.py and pieces.py define them.
#pragma once

#include <functional>
#include <vector>

namespace mbdae {

// What the core cannot go on with; the Python step that is taken instead finds the words for it.
struct FallBackToPython {};
struct StepTooLong : FallBackToPython {};  // a step, for an iteration or for its coordinates: a shorter one may do
struct Interrupted : FallBackToPython {};  // Ctrl-C in a Python function: nothing else may be tried

struct TimeFunction {
  enum Kind { pieces, harmonic, python } kind = pieces;
  std::vector<double> a, b;  // numbers, of pieces: coefficients by pieces, highest power first; starts of pieces
  int degree = 0;            // of pieces
  double period = 0, rise = 0;  // of pieces: after which they come again, by so much higher; 0: never
  std::function<double(double, int)> call;

  double at(double t, int k = 0) const;  // the k-th derivative
};

}  // namespace mbdae
