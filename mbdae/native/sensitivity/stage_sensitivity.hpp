// Tangent and adjoint of a stage of index 2, by its saddle-point system. In coordinates x of a step, q = q_n (+) x, with
// A, R, J, T of `IntegratePartialsBlock` and the partials K, D, B of `EquationPartials`,
//
//   dq = A dq_n + R dx,   dx' = J dv + T dx,   dqhat = Ahat dq_n + Rhat (dxhat + factor dx')
//   [M  -G^T] [dv' ]   [K dq + D du + P dp                                            ]
//   [Ghat  0] [dlam] = [-(Bhat dqhat + Ghat (dv_n + dvhat) + Q dp) / factor           ]
//
// with the matrix of the stage itself; cotangents use its transpose.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// A point with partials with respect to parameters: equations f + G^T lam - M v', and terms of rows.
struct LinearizationPoint {
  struct ConstraintPoint {
    double t;
    Vector q, v;                     // (nq,), (nv,)
    enum Kind { g, rate, Gv } kind;  // g, G v + g_t, G v
    double weight;
    std::vector<WrenchPartials> wrench_partials = {};  // (ng,) of rows in use; not of gaps
  };
  bool loaded = true;      // with laws and gravity
  bool at_rest = false;    // no forces and no motion: P is 0
  const IndependentRows* rows = nullptr;  // the rows that `constraint_points` and `nu` are about; nullptr: those in use
  double t = 0;
  Vector q, u, vdot, lam;              // (nq,), (nv + ns + 1,), (nv,), (ng,)
  std::vector<ActingWrench> wrenches;  // of laws and closures, if placements or frames are parameters
  std::vector<ConstraintPoint> constraint_points;
};

// n = nv + ns + 1; rows in use (r,) are in the order of elimination.
class StageSensitivity : public LinearizationPoint {
 public:
  explicit StageSensitivity(Index2System& s) : point(s.tree, s.constraints, s.counts), s_(s) {}

  double factor = 0;
  EquationPartials at;
  Vector Bhat;        // (r, nv)
  Vector Ghat, Zhat;  // entries by rows, at the constraint point of the stage
  std::vector<IntegratePartialsBlock> integrate_partials, integrate_partials_hat;
  BandLU lu;                            // of Zhat Z^T
  Configuration point;                          // M and its factors, Z

  // The tangent of x' (ny,) for those of x, xhat and y_n (ny,); P dp (n,) and Q dp (r,) may be missing.
  void forward(const double* dx, const double* dxhat, const double* dy, const double* P, const double* Q, double* dF);
  // Adds the cotangents of x, xhat (ny,) and y_n (ny,) of that of x'; `above` (n,) and `nu` (r,) are outputs.
  void reverse(const double* F, double* x, double* xhat, double* y);

  Vector above, nu;

 private:
  // above += Z^T nu with the nu of Z' above = `target_`; Z' and Z are those of the step's matrix or of its transpose.
  void satisfy_rows(const Vector& seen, bool transposed, const Vector& moved);

  Index2System& s_;
  Vector rate_, dq_, du_, more_, target_, residual_;
};

void add_times(const Vector& A, size_t rows, size_t columns, const double* x, double* out);       // out += A x
void add_transposed(const Vector& A, size_t rows, size_t columns, const double* x, double* out);  // out += A^T x

// out = M x with blocks M, or their transposes, and 1 or 0 between them.
void apply(const std::vector<IntegratePartialsBlock>& blocks, double (IntegratePartialsBlock::*M)[36], bool transposed, bool unit, int nv,
           const double* x, double* out);

}  // namespace mbdae
