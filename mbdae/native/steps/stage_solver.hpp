// Linear systems of the stages of a collocation method, one for each eigenvalue of A
// (mbdae/mechanism/formulations/steps/implicit_stage.py).
#pragma once

#include "steps/collocation.hpp"

namespace mbdae {

using Complex = std::complex<double>;

// The system of an eigenvalue. In vectors of a complex eigenvalue, the imaginary parts follow the real parts.
class StageSolver {
 public:
  virtual ~StageSolver() = default;
  // Replace the residuals r (ny,) and c (one for each multiplier z) by the changes of x' and z.
  virtual void solve(double* r, double* c, Vector& work) const = 0;
};

std::shared_ptr<const StageSolver> make_stage_solver(const std::shared_ptr<const LinearizedStages>& partials, int nv,
                                                     Complex mu);

}  // namespace mbdae
