// Half-explicit Runge-Kutta steps (mbdae/methods/half_explicit_step.py,
// mbdae/mechanism/formulations/steps/index2_step.py).
#pragma once

#include "math/fields.hpp"
#include "system/index2.hpp"

namespace mbdae {

struct Tableau {
  Vector A, Ahat;                                         // (n, n) by rows
  Vector b, c, chat;                                      // (n,)
  Vector error_weights;                                   // (errors, n) by rows
  bool explicit_first = false, project_embedded = false;  // the first stage is explicit; project embedded errors
  int doubling_order = 0;  // order p of a method with error control by step doubling; 0: embedded formula
  double noise = 0;        // factor by which the rounding of v exceeds eps |v|
  int n = 0, errors = 0;   // stages, and error estimates

  FIELDS(A, Ahat, b, c, chat, error_weights, explicit_first, project_embedded, doubling_order, noise)
};

class HalfExplicitStep {
 public:
  explicit HalfExplicitStep(Index2System& system);
  virtual ~HalfExplicitStep() = default;

  // Step from t to t + h: state, multipliers of the method (nz,), and error estimates (errors, ny).
  void take(const Tableau& a, double t, double h, const State& in, State& out, double* z, Vector& errors);
  // Step with an error estimate for any method: by step doubling if there is no embedded formula.
  void controlled(const Tableau& a, double t, double h, const State& in, State& out, double* z, Vector& errors);

 protected:
  virtual void begin_step(const double*) {}                         // a step begins at y (length,)
  virtual void first_stage(const Vector& carry, double* F) const;   // y' at an explicit first stage
  virtual void set_carry(const double* F, Vector& carry) const;     // carry to the next step, from the last stage
  // at x_, with the stage constraint at xhat_
  virtual void stage(double t, double t_hat, double factor, double* F, bool last);
  void set_stage_state();  // set q_, v_ and s_in_ at x_
  // Set x' (nv,) of a stage, from J v; evaluate G and Z of the rows in use at its constraint point, and factorize S.
  virtual void satisfy_constraint(double t_hat, double factor, double* dx);
  virtual void project(double* e);                  // project an error (ny,) onto the constraints, in the mass metric
  virtual void all_multipliers(double* z);          // (nz,) of the last stage

  void evaluate_poses(const double* dx, double factor);  // set qhat_ = q_n (+) (xhat + factor x'), and its poses
  void factorize_constraints();                          // G, Z and S of `satisfy_constraint` at the current poses
  void combine(const double* weights, int count, double h, Vector& x) const;  // x = h sum weights_j F_j

  Index2System& s_;
  const int nq_, nv_, ns_, ny_;
  const int stride_;                  // ny padded with zeros, so that loops have no remainder
  Vector F_;                          // (n, stride) time derivatives of stages
  Vector x_, xhat_, dx_;              // (stride,) in coordinates of the step
  Vector q0_, v0_, s0_;               // (nq,), (nv,), (ns,) at the start of the step
  Vector q_, v_, qhat_, s_in_;        // (nq,), (nv,), (nq,), (ns,) at a stage
  Vector f_;                          // (nv,)
  Vector lam_, gt_, gthat_, work_;    // (ng,)
  Vector Ghat_, Zhat_;                // entries by rows, at the constraint point of the stage
  bool with_partials_ = false;        // compute terms of the partials of stages
};

}  // namespace mbdae
