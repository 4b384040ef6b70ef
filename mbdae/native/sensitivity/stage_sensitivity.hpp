// Tangent and adjoint of a stage of index 2, by its saddle-point system. In coordinates x of a step, q = q_n (+) x,
// with A, R, J, T of `IntegratePartialsBlock` and the partials K, D, B of `EquationPartials`,
//
//   dq = A dq_n + R dx,   dx' = J dv + T dx,   dqhat = Ahat dq_n + Rhat (dxhat + factor dx')
//   [M  -G^T] [dv' ]   [K dq + D du + P dp                                            ]
//   [Ghat  0] [dlam] = [-(Bhat dqhat + Ghat (dv_n + dvhat) + Q dp) / factor           ]
//
// with the matrix of the stage; cotangents use its transpose.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// A point at which the equations f + G^T lam - M v' and the rows are differentiated with respect to parameters.
struct LinearizationPoint {
  struct ConstraintPoint {
    double t;
    Vector q, v;                     // (nq,), (nv,)
    enum Kind { g, rate, Gv } kind;  // g, G v + g_t, G v
    double weight;
    std::vector<WrenchPartials> wrench_partials = {};  // (ng,) of rows in use, unless kind is g
  };
  bool has_applied_forces = true;                     // includes laws and gravity
  bool at_rest = false;                   // no forces and no velocity: P is 0
  const IndependentRows* rows = nullptr;  // rows of `constraint_points` and `nu`; nullptr: rows in use
  double t = 0;
  Vector q, u, vdot, lam;              // (nq,), (nv + ns + 1,), (nv,), (ng,)
  std::vector<LawWrench> wrenches;     // wrenches of laws and closures, if placements or frames are parameters
  std::vector<ConstraintPoint> constraint_points;
};

// n = nv + ns + 1; rows in use (r,) are in the order of elimination.
class StageSensitivity : public LinearizationPoint {
 public:
  explicit StageSensitivity(Index2System& s) : point(s.tree, s.constraints, s.counts), s_(s) {}

  double factor = 0;
  EquationPartials partials;
  Vector Bhat;        // (r, nv)
  Vector Ghat, Zhat;  // entries by rows, at the constraint point of the stage
  std::vector<IntegratePartialsBlock> integrate_partials, integrate_partials_hat;
  BandLU lu;                            // factors of Zhat Z^T
  Configuration point;                          // M and its factors, Z

  // The tangent of x' (ny,) from those of x, xhat and y_n (ny,); P dp (n,) and Q dp (r,) may be null.
  void forward(const double* dx, const double* dxhat, const double* dy, const double* P, const double* Q, double* dF);
  // Add to the cotangents of x, xhat and y_n (ny,), from that of x'; also sets `upper` (n,) and `nu` (r,).
  void reverse(const double* F, double* x, double* xhat, double* y);

  Vector upper, nu;

 private:
  // upper += Z^T nu with nu such that Z' upper = `target_`; Z' and Z are constraint_rows and force_rows.
  void satisfy_rows(const Vector& constraint_rows, bool transposed, const Vector& force_rows);

  Index2System& s_;
  Vector rate_, dq_, du_, scratch_, target_, residual_;
};

void add_times(const Vector& A, size_t rows, size_t columns, const double* x, double* out);       // out += A x
void add_transposed(const Vector& A, size_t rows, size_t columns, const double* x, double* out);  // out += A^T x

// out = M x for blocks M or their transposes; outside the blocks M is the identity (unit) or 0.
void apply(const std::vector<IntegratePartialsBlock>& blocks, double (IntegratePartialsBlock::*M)[36], bool transposed, bool unit, int nv,
           const double* x, double* out);

}  // namespace mbdae
