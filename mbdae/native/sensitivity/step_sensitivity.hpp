// A half-explicit step once more, and how it moves (mbdae/methods/step_sensitivity.py).
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"
#include "sensitivity/stage_sensitivity.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

class StepSensitivity : public HalfExplicitStep {
 public:
  StepSensitivity(Index2System& system, Parameters* parameters, bool forward = false);  // or reverse

  // The step from (t, y), which carries (nc,), to t + h; its slopes are kept where they are asked for.
  void repeat(const Tableau& a, double t, double h, const State& in, State& out, bool slopes);
  // Variations (ny + nc,) of y and of what is carried become those behind the step, for dp (k,), direction by direction.
  void forward(int directions, double* moved, const double* dp);
  // Cotangents (ny + nc,) behind the step become those before it; those of parameters are added up.
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
  std::vector<Numbers> P_, Q_;  // of stages, where variations go forward
};

}  // namespace mbdae
