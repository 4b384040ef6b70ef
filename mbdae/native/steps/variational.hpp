// RATTLE steps and their compositions (mbdae/methods/variational.py,
// mbdae/mechanism/formulations/steps/variational.py).
#pragma once

#include <vector>

#include "math/dense_lu.hpp"
#include "steps/newton_iteration.hpp"
#include "system/index2.hpp"

namespace mbdae {

struct Composition {
  Vector weights, nodes;  // (s,), (s + 1,)
  NewtonIteration iteration;

  FIELDS(weights, nodes, iteration)
};

class VariationalStep {
 public:
  explicit VariationalStep(Index2System& system);

  // Step from t to t + h: state, and mu of the last RATTLE step (ng,).
  void take(const Composition& composition, double t, double h, const State& in, State& out, double* z);

 private:
  // Terms of the discrete Lagrangian and of the forces at an end of a step: M, N = d(M w)/dq,
  // D = d(w^T M w/2 - U)/dq + tau with its partials with respect to w, and the power.
  struct EndpointTerms {
    Vector M, N, D, dD_dw;  // (nv, nv), (nv, nv), (nv,), (nv, nv) by rows
    double power = 0;
  };

  void rattle(const NewtonIteration& iteration, double t, double h, const State& in, State& out, double* z);
  void momentum_partials(const double* q, EndpointTerms& out);  // M and N; updates the kinematics at q
  void evaluate_endpoint(double t, const double* q, EndpointTerms& out);
  void correct(Vector& dx);
  std::pair<double, double> change_and_scale(const Vector& dx) const;
  void add_transported_momentum_partials(const double* p, double* matrix);  // d(J(-x)^T p)/dx, (nv, nv) by rows

  Index2System& s_;
  const int nq_, nv_;
  double t_ = 0, h_ = 0;
  Vector q0_, v0_, q1_, G0_;  // q and v at the start, q at the end; (r, nv) G of the rows in use at the start
  Vector x_, w_, zero_;       // (nv + r,) displacement and lam; (nv,) w = x/h; zero
  EndpointTerms start_, end_;
  std::vector<TangentBlock> J_minus_, J_plus_, J_inverse_;  // J(-x), J(x), J(x)^-1
  DenseLU<1> lu_;
  Vector G_, g_, matrix_, mean_, p_, b_, dtau_dv_;
};

}  // namespace mbdae
