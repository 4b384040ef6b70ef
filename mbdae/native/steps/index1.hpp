// Explicit Runge-Kutta steps in the index-1 formulation: stages satisfy only the hidden constraint
// (mbdae/mechanism/formulations/index1.py).
#pragma once

#include "steps/half_explicit_step.hpp"

namespace mbdae {

class Index1Step final : public HalfExplicitStep {
 public:
  explicit Index1Step(Index2System& system) : HalfExplicitStep(system) {}

 protected:
  void stage(double t, double t_hat, double factor, double* F, bool last) override;
};

}  // namespace mbdae
