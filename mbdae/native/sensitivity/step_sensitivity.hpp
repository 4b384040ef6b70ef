// Recompute a half-explicit step of index 2 with its tangent and adjoint: stages by elimination.
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"
#include "sensitivity/stage_sensitivity.hpp"
#include "sensitivity/step_map.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

class StepSensitivity final : public HalfExplicitStep, public StepMap {
 public:
  // forward: for tangents; otherwise for cotangents
  StepSensitivity(Index2System& system, ParameterPartials* parameters, const Tableau& a, bool forward = false);

  // The same without partials, if they are not requested.
  void repeat(double t, double h, const State& in, State& out, bool partials);
  void repeat(double t, double h, const State& in, State& out) override { repeat(t, h, in, out, true); }
  // dh and dt are not supported: `CoupledStages` has them.
  void forward(int directions, double* moved, const double* dp, const double* dh, const double* dt) override;
  void reverse(int costs, double* bar) override;

 private:
  void record_stage(int stage, double t, double that, double factor, const double* F);

  ParameterPartials* parameters_;
  const bool forward_;
  const Tableau& a_;
  double h_ = 0;
  std::vector<std::unique_ptr<StageSensitivity>> stages_;
  std::vector<IntegratePartialsBlock> end_;
  Vector dF_, Q_dp_, x_bar_, xhat_bar_, P_dp_;
  std::vector<Vector> P_, Q_;  // of stages, for tangents
  Vector above_, nu_;          // of a stage, for cotangents: (costs, n), (costs, r)
};

}  // namespace mbdae
