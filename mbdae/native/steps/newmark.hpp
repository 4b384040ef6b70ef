// Steps of Newmark-type methods (mbdae/methods/alpha.py, mbdae/mechanism/formulations/steps/newmark_step.py).
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

class NewmarkStep : private CollocationStep {  // for the residual of a stage
 public:
  explicit NewmarkStep(Index2System& system);

  // From t to t + h: the state, whose carry is (a, u', h), (2 n + 1,), and lam (ng,).
  void take(const GeneralizedAlpha& a, double t, double h, const State& in, State& out, double* z);

 private:
  void start(const GeneralizedAlpha& a, double t, double h, const Vector& y, double* a_0, double* rate);
  void displacement(Vector& out) const;
  void correct(const GeneralizedAlpha& a, double t, Vector& dx);
  std::pair<double, double> measure(const Vector& dx) const;

  const int n_;          // of u
  double h_ = 0, b1_ = 0, b2_ = 0;
  Vector x_, normal_;  // (n + r + m,) u_1', lam, mu; M_0^-1 G_0^T (m, nv) by rows
  Vector known_;       // (ny,) the displacement without unknowns
  EquationPartials at_;
  std::vector<TangentBlock> inverse_;  // J(x)^-1
  DenseLU<1> matrix_;
  Vector full_, R1_, C1_, g_, multipliers_;
};

}  // namespace mbdae
