// Half-explicit Runge-Kutta steps (mbdae/methods/step.py, mbdae/mechanism/formulations/chart.py).
#pragma once

#include "index2.hpp"

namespace mbdae {

struct Tableau {
  int n = 0;                            // stages
  bool first = false, project = false;  // explicit first stage; embedded errors are projected
  Numbers A, Ahat;                      // (n, n) by rows
  Numbers b, c, chat;                   // (n,)
  Numbers e;                            // (errors, n) by rows
  int errors = 0, doubled = 0;          // order p of a method controlled by two half steps; 0: an embedded formula
  double noise = 0;                     // rounding of v by which an error estimate exceeds eps |v|
};

class HalfExplicitStep {
 public:
  explicit HalfExplicitStep(Index2System& system);

  // From t to t + h: the state, lam of the method (ng,), and error estimates (errors, ny).
  void take(const Tableau& a, double t, double h, const State& in, State& out, double* z, Numbers& errors);
  // The same with an error estimate for all methods: of two half steps where there is no embedded formula.
  void controlled(const Tableau& a, double t, double h, const State& in, State& out, double* z, Numbers& errors);

 private:
  void stage(double t, double that, double factor, double* F, bool last);      // at x_, met at xhat_; lam_ is found
  void combine(const double* weights, int count, double h, Numbers& x) const;  // x = h sum of weights times slopes
  void project(double* e);  // the velocity part of an error (ny,), in the mass metric, on G v = 0

  Index2System& s_;
  const int nq_, nv_, ns_, ny_;
  const int stride_;                  // ny and some zeros: loops without remainders
  Numbers F_;                         // (n, stride) slopes by stage
  Numbers x_, xhat_, dx_;             // (stride,) in coordinates of the step
  Numbers q0_, v0_, s0_;              // (nq,), (nv,), (ns,) where the step starts
  Numbers q_, v_, q_met_, s_in_;      // (nq,), (nv,), (nq,), (ns,) at a stage
  Numbers f_;                         // (nv,)
  Numbers lam_, gt_, gt_met_, work_;  // (ng,)
  Numbers Ghat_, Zhat_;               // (ng, nv) by rows, where the stage meets the constraint
};

}  // namespace mbdae
