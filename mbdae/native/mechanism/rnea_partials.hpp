// Exact partials of inverse dynamics on a tree, after S. Singh, R. P. Russell and P. M. Wensing (Efficient analytical
// derivatives of rigid-body dynamics using spatial vector algebra, IEEE Robotics and Automation Letters 7(2), 2022), in
// the world's frame, where the axes of each joint are fixed in its parent body.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace mbdae {

// A body in the world: its mass, centre, and inertia about that by rows.
struct Body {
  double mass, centre[3], I[9];
};

class RneaPartials {
 public:
  // Of each joint, parents first: its parent (-1: none); its degrees of freedom.
  RneaPartials(std::vector<int> parents, std::vector<std::vector<int>> dofs);

  void set(int joint, const Body& body);  // the body of a joint; without it the joint has none
  // M (nv, nv) and nle(q, v), for J (6, nv) by columns, linear part first, about a fixed point, from which the centres
  // of bodies are given; gravity (3,) in m/s^2.
  void begin(const double* J, const double* gravity, const double* v, double* M, double* nle);
  // After `begin`, partials of M a + nle(q, v) with respect to q in the tangent and to v, (nv, nv) by rows; with
  // `inertia_only` those of M a, for v = 0.
  void complete(const double* a, double* by_q, double* by_v, bool inertia_only);

 private:
  // Of a body, or of the subtree of a joint: inertia (mass, moment, and about the origin: xx, xy, yy, xz, yz, zz),
  // momentum h = (p, L), wrench f, and S: its wrench for a motion of its parent with the angular velocity w is
  // D w = (2 w x p, S w + w x L).
  struct InertiaTerms {
    double mass = 0, moment[3] = {}, I[6] = {};
    Six h{}, f{};
    double S[6] = {};

    void set_motion(const double* V, const double* A);
    void momentum(const double* x, double* out) const;  // for the motion x
    void add_D(const double* angular, double* out) const;
    void D_transposed(const double* x, double* angular) const;
  };
  // Of a degree of freedom, where V and A are those of the parent.
  struct Column {
    Six J, IJ;
    double DJ[3];     // the angular part of D^T J; the linear one is 0
    Six psi_dot, psi_ddot;   // V x J, A x J + V x (V x J), as in the source
    Six psi_dot_plus_S_dot;  // V x J plus the rate of J
  };

  void update_motion(int joint, const double* J, const double* v);

  const std::vector<int> parents_;
  const std::vector<std::vector<int>> dofs_;
  std::vector<std::vector<int>> ancestor_dofs_;  // of each joint: the degrees of freedom of all its ancestors
  std::vector<InertiaTerms> bodies_, subtrees_;
  std::vector<bool> has_mass_;
  Six base_{};              // initial value of A: gravity
  std::vector<Six> V_, A_;  // of each joint; A for v' = 0
  std::vector<Six> Aa_, f_;  // terms of a in A, and in the wrench of the subtree
  std::vector<Column> columns_;
};

}  // namespace mbdae
