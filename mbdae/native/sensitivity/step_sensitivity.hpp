// Recompute a half-explicit step with its tangent and adjoint (mbdae/methods/step_sensitivity.py).
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"
#include "sensitivity/stage_sensitivity.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

class StepSensitivity : public HalfExplicitStep {
 public:
  StepSensitivity(Index2System& system, Parameters* parameters, bool forward = false);  // or reverse

  // The step from (t, y), with its carry (nc,), to t + h; its partials are kept if requested.
  void repeat(const Tableau& a, double t, double h, const State& in, State& out, bool partials);
  // Tangents (ny + nc,) of y and of the carry become those at the end of the step, for dp (k,), direction by direction.
  void forward(int directions, double* moved, const double* dp);
  // Cotangents (ny + nc,) at the end of the step become those at its start; those of parameters are accumulated.
  void reverse(double* bar);

 private:
  void keep(int stage, double t, double that, double factor, const double* F);

  Parameters* parameters_;
  const bool forward_;
  const Tableau* a_ = nullptr;
  double h_ = 0;
  std::vector<std::unique_ptr<StageSensitivity>> stages_;
  std::vector<IntegratePartialsBlock> end_;
  Numbers dF_, dx_end_, x_bar_, xhat_bar_, p_;
  std::vector<Numbers> P_, Q_;  // of stages, for tangents
};

}  // namespace mbdae
