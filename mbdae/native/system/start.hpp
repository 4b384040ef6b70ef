// The start of a run, and its first step size (mbdae/system.py, mbdae/integrate/steppers/adaptive.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// Determine rank and rows in use at the projection of y onto the closures, which replaces y if `project`; compute y'
// (ny,) and lam (ng,) at y. FallBackToPython, with unknown rank, if Python must decide.
void start(Index2System& system, double t, bool project, const IndependentRows::InitialRank& first, Vector& y, Vector& F,
           Vector& z);

struct FirstStep {
  double sign, left;  // direction of time; s to the end of the smooth interval
  double rtol;
  Vector atol;                      // (1,) or (components under error control,)
  double power;                     // power of h in the error estimate
  double small_norm, default_step;  // norms below it are small; h_0 in s for small norms
  double reduction;                 // h_1 / h_0 if y' does not change
  double change, growth;            // relative change of y in a step of h_0; largest h_1 / h_0
  double zero_change, tiny;         // norm that counts as no change; keeps scales positive

  FIELDS(sign, left, rtol, atol, power, small_norm, default_step, reduction, change, growth, zero_change, tiny)
};
// The first step size in s, by Hairer's algorithm (Hairer, Noersett, Wanner I, II.4).
double first_step(Index2System& system, double t, const Vector& y, const Vector& F, const FirstStep& settings);

}  // namespace mbdae
