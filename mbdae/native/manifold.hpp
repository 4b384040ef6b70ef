// The configuration manifold of a model, and the tangent map x' = J(x) v of a step (mbdae/mechanism/manifold.py).
#pragma once

#include <vector>

#include "linear.hpp"
#include "mechanics.hpp"

namespace mbdae {

// A block of the tangent map: a spherical, free-flying or planar joint.
struct Block {
  enum Kind { so3, se3, se2 } kind;
  int at;
};

class Manifold {
 public:
  Manifold(Mechanics& m, bool flat, std::vector<Block> blocks, std::vector<int> turning);

  const bool flat;  // a vector space

  void integrate(const double* q, const double* x, double* out) const;     // q (+) x, (nq,)
  void difference(const double* q0, const double* q1, double* out) const;  // q1 (-) q0, (nv,)
  void size(const double* q, double* out) const;                           // magnitudes in the tangent, (nv,)
  void within(const double* x) const;               // Trouble where a joint turns too far in one step
  void tangent(const double* x, double* dx) const;  // dx: v (nv,) becomes J(x) v

 private:
  Mechanics& m_;
  std::vector<Block> blocks_;
  std::vector<int> turning_;  // (nv,) flags: rotations, which have no magnitude of their own
  Numbers neutral_;           // (nq,)
};

// y = J x, J = 1 + X/2 + sum B_2k/(2k)! X^2k with X = ad (n, n) by rows: the inverse right Jacobian of exp.
void inverse_jacobian(const Limits& limits, int n, const double* ad, const double* x, double* y);

}  // namespace mbdae
