// How a projected end of a step moves (mbdae/mechanism/discrete_sensitivity/projection_sensitivity.py).
#pragma once

#include <memory>

#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

class ProjectionSensitivity {
 public:
  ProjectionSensitivity(Index2System& system, Parameters& parameters, bool forward);  // or reverse

  void take(double t, double* y);  // y (length,) becomes the nearest point that meets the closures
  // Variations dy (ny,) become those of that point, for dp (k,); direction by direction, `width` numbers apart.
  void forward(int directions, double* moved, size_t width, const double* dp);
  void reverse(double* y);  // cotangents (ny,) of that point become those of the given one

 private:
  // A correction x of least x^T M x with G x = r, and eta: M x = G^T eta.
  struct Correction {
    LinearisationPoint point;
    bool of_v = false, moved = false;  // moved: x counts
    std::vector<int> rows;             // (r,) that it meets
    BandLU lu;                         // of G M^-1 G^T
    Numbers G, Z;                      // (ng, nv)
    Numbers K, B, T, Bv;               // (nv, nv), (r, nv), (nv, nv), (r, nv); as in corrections.py
    std::vector<IntegratePartialsBlock> turn;
    Numbers P, Q;                      // (k, n) where moved, and (k, r); where variations go forward
  };

  void correct(Correction& c, double t, const double* q, const double* v, const Numbers& r);
  void solve(const Correction& c, double* above, double* below) const;  // becomes x, eta; (nv,) and (ng,) by row

  Index2System& s_;
  Parameters& parameters_;
  const bool forward_;
  Configuration factors_;  // of M where it starts
  Numbers q0_;  // where it starts
  std::vector<std::unique_ptr<Correction>> corrections_;
  size_t count_ = 0;
};

}  // namespace mbdae
