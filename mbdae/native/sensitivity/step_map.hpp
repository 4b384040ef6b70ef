// A step as a map of y and the carry, with its tangent and adjoint.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

class StepMap {
 public:
  virtual ~StepMap() = default;
  // Recompute the step from (t, y), with the carry (nc,), to t + h, and store its partials.
  virtual void repeat(double t, double h, const State& in, State& out) = 0;
  // Replace tangents (ny + nc,) of y and the carry by those at the end of the step, for dp (k,), and for changes dh of
  // the step size and dt of its start, (directions,), which may be null; direction by direction.
  virtual void forward(int directions, double* tangents, const double* dp, const double* dh, const double* dt) = 0;
  // Replace cotangents (costs, ny + nc) at the end of the step by those at its start; accumulate those of parameters.
  virtual void reverse(int costs, double* cotangents) = 0;
};

}  // namespace mbdae
