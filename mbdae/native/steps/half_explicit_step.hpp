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
  bool explicit_first = false, project_embedded = false;  // explicit first stage; embedded errors are projected
  int doubling_order = 0;  // order p of a method controlled by step doubling; 0: an embedded formula
  double noise = 0;        // rounding of v by which an error estimate exceeds eps |v|
  int n = 0, errors = 0;   // stages, and error estimates

  FIELDS(A, Ahat, b, c, chat, error_weights, explicit_first, project_embedded, doubling_order, noise)
};

class HalfExplicitStep {
 public:
  explicit HalfExplicitStep(Index2System& system);
  virtual ~HalfExplicitStep() = default;

  // From t to t + h: the state, multipliers of the method (nz,), and error estimates (errors, ny).
  void take(const Tableau& a, double t, double h, const State& in, State& out, double* z, Vector& errors);
  // The same with an error estimate for all methods: by step doubling if there is no embedded formula.
  void controlled(const Tableau& a, double t, double h, const State& in, State& out, double* z, Vector& errors);

 protected:
  virtual void begin_step(const double*) {}                         // a step begins at y (length,)
  virtual void first_stage(const Vector& carry, double* F) const;   // time derivative at an explicit first stage
  virtual void set_carry(const double* F, Vector& carry) const;     // carry of the last stage to the next step
  virtual void stage(double t, double that, double factor, double* F, bool last);  // at x_, constraint at xhat_
  void place_stage();                                                              // q_, v_ and s_in_ at x_
  // x' (nv,), from J v, of a stage; G and Z of the rows in use at its constraint point, S factorized.
  virtual void satisfy_constraint(double that, double factor, double* dx);
  virtual void project(double* e);                  // an error (ny,), in the mass metric, onto the kept constraints
  virtual void all_multipliers(double* z);          // (nz,) of the last stage

  void evaluate_poses(const double* dx, double factor);  // qhat_ and poses there: q_n (+) (xhat + factor x')
  void factorize_constraints();                          // second part of `satisfy_constraint`, at the current poses
  void combine(const double* weights, int count, double h, Vector& x) const;  // x = h sum of weights times derivatives

  Index2System& s_;
  const int nq_, nv_, ns_, ny_;
  const int stride_;                  // ny and some zeros: loops without remainders
  Vector F_;                          // (n, stride) time derivatives by stage
  Vector x_, xhat_, dx_;              // (stride,) in coordinates of the step
  Vector q0_, v0_, s0_;               // (nq,), (nv,), (ns,) at the start of the step
  Vector q_, v_, qhat_, s_in_;        // (nq,), (nv,), (nq,), (ns,) at a stage
  Vector f_;                          // (nv,)
  Vector lam_, gt_, gthat_, work_;    // (ng,)
  Vector Ghat_, Zhat_;                // entries by rows, at the constraint point of the stage
  bool with_partials_ = false;               // partials of stages are needed next
};

}  // namespace mbdae
