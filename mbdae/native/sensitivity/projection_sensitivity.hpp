// Sensitivity of projections (mbdae/mechanism/formulations/steps/projection.py): states onto the closures, and
// velocities onto rows newly in use. A correction is the x of least x^T M x with G x = r, so that with multipliers eta
//
//   M dx - G^T deta = d(G^T eta) dq + (G^T eta - M x)_p dp - dM x dq_0,   G dx = dr - d(G x) dq - (G x)_p dp
//
// where M is evaluated at q_0, the end of the step, and G at q, on the way from it to the closures.
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

class ProjectionSensitivity {
 public:
  ProjectionSensitivity(Index2System& system, ParameterPartials& parameters, bool forward);  // or reverse

  // y (length,) becomes the nearest point that satisfies the closures; or v alone the nearest that they allow.
  void take(double t, double* y, bool positions = true);
  // Tangents dy (ny,) become those of that point, for dp (k,) and dt, which may be missing; direction by direction,
  // `width` numbers apart.
  void forward(int directions, double* moved, size_t width, const double* dp, const double* dt);
  // Cotangents (costs, width) of that point become those of the given one.
  void reverse(int costs, double* bars, size_t width);

 private:
  // A correction x of least x^T M x with G x = r, and eta: M x = G^T eta.
  struct Correction {
    LinearizationPoint point;
    bool of_v = false, moved = false;  // moved: x is nonzero
    std::vector<int> rows;             // (r,) that it satisfies
    BandLU lu;                         // of G M^-1 G^T
    Vector G, Z, x;                    // entries by rows twice, (nv,)
    Vector K, B, T, Bv;                // (nv, nv), (r, nv), (nv, nv), (r, nv); see correct()
    std::vector<IntegratePartialsBlock> integrate_partials;
    Vector P, Q;  // (k, n) where moved, and (k, r); for tangents
    Vector by_t;  // (ng,) of what it corrects
  };

  void correct(Correction& c, double t, const double* q, const double* v, const Vector& r);
  void solve(const Correction& c, double* above, double* below) const;  // becomes x, eta; (nv,) and (ng,) by row
  void solve_transposed(const Correction& c, double* above, double* below) const;  // below: 0 before; (r,) after

  Index2System& s_;
  ParameterPartials& parameters_;
  const bool forward_;
  Configuration factors_;  // of M at its start
  Vector q0_;              // its start
  std::vector<std::unique_ptr<Correction>> corrections_;
  size_t count_ = 0;
};

}  // namespace mbdae
