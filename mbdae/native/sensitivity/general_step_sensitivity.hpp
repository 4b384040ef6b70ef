// Tangent and adjoint of steps from all equations of their stages (stage_equations.hpp): half-explicit steps stage by
// stage, collocation steps as one system.
//
//   F_i, z_i from the equations of stage i,   dX_i = h sum_j a_ij dF_j + dh sum_j a_ij F_j,   Xhat_i with ahat_ij
//   dy_1 = Y dy + X (h sum b_i dF_i + dh sum b_i F_i)
//
// Collocation steps are solved to rounding, so that the implicit function theorem applies: the initial guess and the
// iteration have no effect. Source: Hager, Numer. Math. 87 (2000), for explicit methods.
#pragma once

#include <memory>

#include "math/dense_lu.hpp"
#include "sensitivity/stage_equations.hpp"
#include "sensitivity/step_map.hpp"
#include "steps/collocation.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

struct StepCoefficients {
  int n = 0, first = 0;  // number of stages, and of explicit stages
  bool fully_implicit = false;  // collocation: all stages are one system
  Vector A, Ahat, b, c, chat;
  explicit StepCoefficients(const Tableau& a);
  explicit StepCoefficients(const Radau& a);
};

// A step that records its stages.
class StageRecorder {
 public:
  virtual ~StageRecorder() = default;
  virtual void take(double t, double h, const State& in, State& out) = 0;
  // For Newton's method on all stages, of collocation steps that fail otherwise: an initial guess from y'_n, or the
  // extrapolated polynomial of a step of half the size; negative residual of a stage, (m,); Newton correction of all
  // stages; final state. Each sets `stages` and `F`.
  virtual void initial_guess(double, double, const State&) { throw StepTooLong(); }
  virtual void extend(double) {}
  virtual Eigen::VectorXd negative_residual(int) { return {}; }
  virtual void correct(const Rows<double>&) {}  // (n, m)
  virtual void finish(const State&, State&) {}
  std::vector<StageValues> stages;
  Rows<double> F;                               // (n, ny)
  const IndependentRows* positions = nullptr;   // rows of mu
};

std::unique_ptr<StageRecorder> recorder(Index2System& s, const Tableau& a);
std::unique_ptr<StageRecorder> recorder(Index2System& s, const Radau& a);

class GeneralStepSensitivity final : public StepMap {
 public:
  GeneralStepSensitivity(Index2System& s, ParameterPartials& parameters, bool forward, StepCoefficients a,
                std::unique_ptr<StageRecorder> steps);

  void repeat(double t, double h, const State& in, State& out) override;
  void forward(int directions, double* tangents, const double* dp, const double* dh, const double* dt) override;
  void reverse(int costs, double* cotangents) override;

 private:
  using Matrix = Eigen::MatrixXd;
  // A factorized matrix; its rows differ by powers of h, so that solutions need one step of refinement.
  struct System {
    Matrix A;
    DenseLU<1> lu;
    void factorize(Matrix a);
    Matrix solve(const Matrix& b) const;
    Matrix solve_transposed(const Matrix& b) const;
  };

  void linearize(const Vector& y);
  void newton(double t, double h, const State& in, int halvings);
  void add_stage_partials(Rows<double>& matrix, int i, int j) const;  // add the partials of stage i with respect to F_j
  int mu_velocity_start() const { return steps_->positions ? s_.ny + r_ : -1; }

  Index2System& s_;
  ParameterPartials& parameters_;
  const bool forward_;
  const StepCoefficients a_;
  std::unique_ptr<StageRecorder> steps_;
  double h_ = 0;
  int r_ = 0;
  std::vector<std::unique_ptr<StageEquations>> stages_;
  std::vector<System> systems_;  // one for each stage, or one for all
  std::vector<IntegratePartialsBlock> end_;
};

}  // namespace mbdae
