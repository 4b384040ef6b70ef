// Functions of time with two derivatives (mbdae/mechanism/time_functions/time_functions.py, piecewise_polynomial.py).
#pragma once

#include <functional>
#include <vector>

#include "math/dual.hpp"
#include "math/fields.hpp"

namespace mbdae {

// Thrown if the core fails: Python takes the step instead, and writes the message.
struct FallBackToPython {};
struct StepTooLong : FallBackToPython {};  // for its iteration or its coordinates: a shorter one may succeed
struct Interrupted : FallBackToPython {};  // Ctrl-C in a Python function: no further attempts

struct TimeFunction {
  NAMED_ENUM(enum, Kind, polynomials, harmonic, python)
  Kind kind = polynomials;
  std::vector<double> a, b;  // parameters; of polynomials: coefficients, highest power first, and starts
  int degree = 0;            // degree of polynomials
  double period = 0, rise = 0;  // period of polynomials, and increase per period; 0: none
  int input = -1;               // input that sets this linear polynomial; -1: none
  std::function<double(double t, int k)> call;  // Python function

  FIELDS(kind, a, b, degree, period, rise, input)

  void set(int input_, double t, double value, double rate) {  // to value + rate (t' - t), if this is the input
    if (input == input_) a = {rate, value}, b = {t};
  }

  double at(double t, int k = 0) const;  // the k-th derivative
  template <int N>
  Dual<N> at(const Dual<N>& t) const {
    return chain(t, at(t.x), at(t.x, 1));
  }
};

}  // namespace mbdae
