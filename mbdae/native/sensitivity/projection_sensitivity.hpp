// Sensitivity of projections (mbdae/mechanism/formulations/steps/projection.py): of states onto the closures, and of
// velocities onto new rows in use. A correction x minimizes x^T M x with G x = r, so that with multipliers eta
//
//   M dx - G^T deta = d(G^T eta) dq + (G^T eta - M x)_p dp - dM x dq_0,   G dx = dr - d(G x) dq - (G x)_p dp
//
// where M is evaluated at q_0, the end of the step, and G at q, an iterate of the projection.
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

class ProjectionSensitivity {
 public:
  // forward: tangents; otherwise cotangents
  ProjectionSensitivity(Index2System& system, ParameterPartials& parameters, bool forward);

  // Project y (length,), or v alone, onto the closures.
  void take(double t, double* y, bool positions = true);
  // Replace tangents dy (ny,) by those of the projected point, for dp (k,) and dt, which may be null; directions are
  // `width` entries apart.
  void forward(int directions, double* tangents, size_t width, const double* dp, const double* dt);
  // Replace cotangents (costs, width) of the projected point by those of y.
  void reverse(int costs, double* cotangents, size_t width);

 private:
  // A correction x that minimizes x^T M x with G x = r, and its multipliers eta: M x = G^T eta.
  struct Correction {
    LinearizationPoint point;
    bool velocity_level = false, is_nonzero = false;  // is_nonzero: of x
    std::vector<int> rows;                            // (r,) rows that it satisfies
    BandLU lu;                         // factors of G M^-1 G^T
    Vector G, Z, x;                    // entries by rows, entries by rows, (nv,)
    Vector K, B, T, Bv;                // (nv, nv), (r, nv), (nv, nv), (r, nv); see correct()
    std::vector<IntegratePartialsBlock> integrate_partials;
    Vector P, Q;   // (k, n) if x is nonzero, and (k, r); for tangents
    Vector dr_dt;  // (ng,) partials of r with respect to t
  };

  void correct(Correction& c, double t, const double* q, const double* v, const Vector& r);
  void solve(const Correction& c, double* upper, double* lower) const;  // replaced by x (nv,) and eta (ng,) by row
  void solve_transposed(const Correction& c, double* upper, double* lower) const;  // lower: (r,), initially 0

  Index2System& s_;
  ParameterPartials& parameters_;
  const bool forward_;
  Configuration factors_;  // factors of M at q_0
  Vector q0_;              // start of the projection
  std::vector<std::unique_ptr<Correction>> corrections_;
  size_t count_ = 0;
};

}  // namespace mbdae
