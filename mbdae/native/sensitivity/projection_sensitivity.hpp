// Sensitivity of a projected end of a step (mbdae/mechanism/discrete_sensitivity/projection_sensitivity.py).
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

class ProjectionSensitivity {
 public:
  ProjectionSensitivity(Index2System& system, Parameters& parameters, bool forward);  // or reverse

  void take(double t, double* y);  // y (length,) becomes the nearest point that satisfies the closures
  // Tangents dy (ny,) become those of that point, for dp (k,); direction by direction, `width` numbers apart.
  void forward(int directions, double* moved, size_t width, const double* dp);
  void reverse(double* y);  // cotangents (ny,) of that point become those of the given one

 private:
  // A correction x of least x^T M x with G x = r, and eta: M x = G^T eta.
  struct Correction {
    LinearisationPoint point;
    bool of_v = false, moved = false;  // moved: x is nonzero
    std::vector<int> rows;             // (r,) that it satisfies
    BandLU lu;                         // of G M^-1 G^T
    Numbers G, Z;                      // (ng, nv)
    Numbers K, B, T, Bv;               // (nv, nv), (r, nv), (nv, nv), (r, nv); as in projection_sensitivity.py
    std::vector<IntegratePartialsBlock> turn;
    Numbers P, Q;                      // (k, n) where moved, and (k, r); for tangents
  };

  void correct(Correction& c, double t, const double* q, const double* v, const Numbers& r);
  void solve(const Correction& c, double* above, double* below) const;  // becomes x, eta; (nv,) and (ng,) by row

  Index2System& s_;
  Parameters& parameters_;
  const bool forward_;
  Configuration factors_;  // of M at its start
  Numbers q0_;  // its start
  std::vector<std::unique_ptr<Correction>> corrections_;
  size_t count_ = 0;
};

}  // namespace mbdae
