// All equations of a stage and their partials, for GGL and collocation stages, and for steps of varying size.
#pragma once

#include "math/eigen_types.hpp"
#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

struct StageValues {
  double t, t_hat;
  Vector x, xhat;        // (ny,), and (2 nv,) of the constraint point: increments, with the term of the stage itself
  Vector F;              // (ny,) x'
  Vector lam, mu, mu_velocity;  // (ng,), (ng,) by row, (nv,) M^-1 P^T mu; the last two of GGL
};

// With dq = A dq_n + R dx, du = du_n + dx_u, and dqhat, dvhat from dxhat, in the unknowns (x', u', lam, w = M^-1 P^T
// mu, mu):
//
//   dx' - J (dv + dw) - T dx = 0                           M dw - P^T dmu - W dq = (P^T mu - M w)_p dp
//   E du' - K dq - D du - L dlam = P dp + f_t dt           Phat dqhat = -g_p dp - g_t dthat
//   Bhat dqhat + Ghat dvhat = -Q dp - (G v + g_t)_t dthat
//
// where P are the position rows, W = d(P^T mu)/dq - dM w; the equations on the right are those of GGL.
class StageEquations {
 public:
  // forward: tangents; otherwise cotangents
  StageEquations(Index2System& system, ParameterPartials& parameters, bool forward);

  void take(const double* y0, const StageValues& stage, const IndependentRows* positions);
  int size() const { return m_; }
  // Add the cotangents of the parameters, from those of the equations, (m, costs).
  void add_parameters(const Eigen::MatrixXd& equation_cotangents);

  Rows<double> unknown_partials, x, xhat, y;  // (m, m) at fixed x and xhat; (m, ny), (m, 2 nv), (m, ny)
  Rows<double> p;                             // (m, k), for tangents
  Eigen::VectorXd t, t_hat;       // (m,)

 private:
  void constraints(const double* y0, const StageValues& stage);
  void motion(const double* y0, const StageValues& stage);
  void positions(const StageValues& stage);
  void friction();

  Index2System& s_;
  ParameterPartials& parameters_;
  const bool forward_;
  const IndependentRows* position_rows_ = nullptr;
  int m_ = 0, r_ = 0, k_ = 0, n_ = 0;
  LinearizationPoint point_, mu_point_;  // with lam, and with mu
  EquationPartials partials_;
  Vector Bhat_, M_, G_, dtau_dq_, dtau_dv_, time_, P_, Q_, friction_columns_;
  std::vector<IntegratePartialsBlock> integrate_partials_, integrate_partials_hat_;
};

}  // namespace mbdae
