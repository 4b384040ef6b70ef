// The configuration manifold of a model, and the tangent map x' = J(x) v of a step (mbdae/mechanism/tree/manifold.py).
#pragma once

#include <vector>

#include "math/factorizations.hpp"
#include "math/fields.hpp"
#include "mechanism/multibody_tree.hpp"

namespace mbdae {

// A joint whose configurations are a Lie group, with a block of the tangent map: spherical, free-flying or planar.
struct GroupJoint {
  NAMED_ENUM(enum, Kind, so3, se3, se2)
  Kind kind;
  int iv, iq;  // first index in v, and in q

  FIELDS(kind, iv, iq)
};

// J(x) and d(J(x) v)/dx at a block, (n, n) by rows.
struct TangentBlock {
  int start, n;
  double J[36], dJv[36];
};

// a := J^T a, where J is the identity outside the blocks; the entries of a are `stride` apart.
void multiply_transposed(const std::vector<TangentBlock>& blocks, double* a, int stride = 1);
void multiply_rows(const std::vector<TangentBlock>& blocks, Vector& X, int n);  // X := X J for X (k, n) by rows

// Partials of a block: d(q (+) x) = A dq + R dx, d(J(x) v) = J dv + T dx, (n, n) by rows.
struct IntegratePartialsBlock {
  int start, n;
  double A[36], R[36], J[36], T[36];
};

class Manifold {
 public:
  Manifold(MultibodyTree& m, bool flat, std::vector<GroupJoint> group_joints, std::vector<int> angular);

  const bool flat;  // a vector space
  bool curved() const { return !group_joints_.empty(); }  // J(x) is not the identity

  void integrate(const double* q, const double* x, double* out) const;     // q (+) x, (nq,)
  void difference(const double* q0, const double* q1, double* out) const;  // q1 (-) q0, (nv,)
  void component_magnitudes(const double* q, double* out) const;           // magnitudes of q in the tangent, (nv,)
  double largest_rotation(const double* x) const;  // largest rotation of a joint, in rad
  void check_rotations(const double* x) const;     // throws if a joint rotates too far in one step
  void tangent(const double* x, double* dx) const;  // dx: v (nv,) becomes J(x) v
  void velocity(const double* x, double* v) const;  // v: x' (nv,) becomes J(x)^-1 x'
  void transfer(const double* x, const double* to, std::vector<TangentBlock>& out) const;  // J(to)^-1 J(x), in J
  void integrate_partials(const double* x, const double* v, std::vector<IntegratePartialsBlock>& out) const;
  // J(x), and d(J(x) v)/dx where J may differ from 1: (n, n) by rows for each block.
  void partials(const double* x, const double* v, std::vector<TangentBlock>& out) const;

 private:
  MultibodyTree& m_;
  std::vector<GroupJoint> group_joints_;
  std::vector<int> angular_;  // (nv,) flags of rotations, whose characteristic magnitude is 1
  Vector neutral_;            // (nq,)
};

}  // namespace mbdae
