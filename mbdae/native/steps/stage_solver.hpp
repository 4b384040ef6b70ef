// Linear systems of a stage of a collocation method, one for each mode (mbdae/mechanism/formulations/steps/implicit_stage.py).
#pragma once

#include "steps/collocation.hpp"

namespace mbdae {

using Complex = std::complex<double>;

// The system of one stage for a mode. Vectors of a complex mode have their imaginary parts after the real ones.
class StageSolver {
 public:
  virtual ~StageSolver() = default;
  // r (ny,) becomes the change of x', c (r,) that of z.
  virtual void solve(double* r, double* c, Vector& work) const = 0;
};

std::shared_ptr<const StageSolver> solver(const std::shared_ptr<const LinearizedStages>& partials, int nv, Complex mu);

}  // namespace mbdae
