// A recomputed half-explicit step of index 2 with its tangent and adjoint: stages by elimination.
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"
#include "sensitivity/stage_sensitivity.hpp"
#include "sensitivity/step_map.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

class StepSensitivity final : public HalfExplicitStep, public StepMap {
 public:
  // forward: tangents; otherwise cotangents
  StepSensitivity(Index2System& system, ParameterPartials* parameters, const Tableau& a, bool forward = false);

  // partials: whether to store the partials of the step.
  void repeat(double t, double h, const State& in, State& out, bool partials);
  void repeat(double t, double h, const State& in, State& out) override { repeat(t, h, in, out, true); }
  // dh and dt are ignored; `GeneralStepSensitivity` supports them.
  void forward(int directions, double* tangents, const double* dp, const double* dh, const double* dt) override;
  void reverse(int costs, double* cotangents) override;

 private:
  void record_stage(int stage, double t, double t_hat, double factor, const double* F);

  ParameterPartials* parameters_;
  const bool forward_;
  const Tableau& a_;
  double h_ = 0;
  std::vector<std::unique_ptr<StageSensitivity>> stages_;
  std::vector<IntegratePartialsBlock> end_;
  Vector dF_, Q_dp_, x_bar_, xhat_bar_, P_dp_;
  std::vector<Vector> P_, Q_;  // P and Q of stages, for tangents
  Vector upper_, nu_;          // cotangents of a stage, (costs, n) and (costs, r)
};

}  // namespace mbdae
