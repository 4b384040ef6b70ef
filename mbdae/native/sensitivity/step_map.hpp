// A step as a map of y and of the carry, with its tangent and adjoint.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

class StepMap {
 public:
  virtual ~StepMap() = default;
  // The step from (t, y), with its carry (nc,), to t + h; its partials are kept.
  virtual void repeat(double t, double h, const State& in, State& out) = 0;
  // Tangents (ny + nc,) of y and of the carry become those at the end of the step, for dp (k,), direction by direction;
  // and for changes dh of the step size and dt of its start, (directions,), which may be missing.
  virtual void forward(int directions, double* moved, const double* dp, const double* dh, const double* dt) = 0;
  // Cotangents (costs, ny + nc) at the end of the step become those at its start; those of parameters are accumulated.
  virtual void reverse(int costs, double* bar) = 0;
};

}  // namespace mbdae
