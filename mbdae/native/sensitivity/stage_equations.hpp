// All equations of a stage with their partials, for stages of GGL and of collocation, and for steps of varying size.
#pragma once

#include "math/eigen_types.hpp"
#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

struct StageValues {
  double t, that;
  Vector x, xhat;        // (ny,), and (2 nv,) of the constraint point: increments with the own part of the stage
  Vector F;              // (ny,) x'
  Vector lam, mu, slip;  // (ng,) by row twice, (nv,); the last two are those of GGL
};

// With dq = A dq_n + R dx, du = du_n + dx_u, and dqhat, dvhat from dxhat, in the unknowns (x', u', lam, slip, mu):
//
//   dx' - J (dv + dslip) - T dx = 0                        M dslip - P^T dmu - W dq = (P^T mu - M slip)_p dp
//   E du' - K dq - D du - L dlam = P dp + f_t dt           Phat dqhat = -g_p dp - g_t dthat
//   Bhat dqhat + Ghat dvhat = -Q dp - (G v + g_t)_t dthat
//
// where P are the position rows, W = d(P^T mu)/dq - dM slip; the equations on the right exist in GGL alone.
class StageEquations {
 public:
  StageEquations(Index2System& system, ParameterPartials& parameters, bool forward);  // or reverse

  void take(const double* y0, const StageValues& at, const IndependentRows* positions);
  int size() const { return m_; }
  // The cotangents of the parameters, of those of the equations, (m,).
  void add_parameters(const Eigen::MatrixXd& mu);

  Rows<double> by_unknowns, x, xhat, y;  // (m, m) d/d(unknowns), x and xhat fixed; (m, ny), (m, 2 nv), (m, ny)
  Rows<double> p;                // (m, k); for tangents
  Eigen::VectorXd t, that;       // (m,)

 private:
  void constraints(const double* y0, const StageValues& at);
  void motion(const double* y0, const StageValues& at);
  void positions(const StageValues& at);
  void friction();

  Index2System& s_;
  ParameterPartials& parameters_;
  const bool forward_;
  const IndependentRows* position_rows_ = nullptr;
  int m_ = 0, r_ = 0, k_ = 0, n_ = 0;
  LinearizationPoint point_, slip_;  // of lam, and of mu
  EquationPartials at_;
  Vector Bhat_, M_, G_, by_q_, by_v_, time_, P_, Q_, friction_columns_;
  std::vector<IntegratePartialsBlock> integrate_partials_, integrate_partials_hat_;
};

}  // namespace mbdae
