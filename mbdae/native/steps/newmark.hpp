// Newmark-type steps: generalized alpha and HHT (mbdae/methods/alpha.py,
// mbdae/mechanism/formulations/steps/newmark_step.py).
#pragma once

#include <vector>

#include "math/dense_lu.hpp"
#include "steps/collocation.hpp"
#include "steps/newton_iteration.hpp"

namespace mbdae {

struct GeneralizedAlpha {
  double alpha_m = 0, alpha_f = 0, beta = 0, gamma = 0;
  bool stabilized = false;
  NewtonIteration iteration;

  FIELDS(alpha_m, alpha_f, beta, gamma, stabilized, iteration)
};

class NewmarkStep : private CollocationStep {  // uses its stage residual
 public:
  explicit NewmarkStep(Index2System& system);

  // Step from t to t + h: state, with the carry (a, u', h), (2 n + 1,), and lam (ng,).
  void take(const GeneralizedAlpha& a, double t, double h, const State& in, State& out, double* z);

 private:
  void start(const GeneralizedAlpha& a, double t, double h, const Vector& y, double* a_0, double* rate);
  void set_displacement(Vector& out) const;
  void correct(const GeneralizedAlpha& a, double t, Vector& dx);
  std::pair<double, double> change_and_scale(const Vector& dx) const;

  const int n_;  // size of u
  double h_ = 0, b1_ = 0, b2_ = 0;
  Vector x_, normal_;  // (n + r + m,) u_1', lam, mu; M_0^-1 G_0^T (m, nv) by rows
  Vector predictor_;   // (ny,) the displacement for zero unknowns
  EquationPartials partials_;
  std::vector<TangentBlock> inverse_;  // J(x)^-1
  DenseLU<1> matrix_;
  Vector displacement_, R1_, C1_, g_, multipliers_;
};

}  // namespace mbdae
