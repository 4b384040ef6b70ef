// Exact partials of inverse dynamics on a tree, after S. Singh, R. P. Russell and P. M. Wensing (Efficient analytical
// derivatives of rigid-body dynamics using spatial vector algebra, IEEE Robotics and Automation Letters 7(2), 2022), in
// the world frame, where the axes of each joint are fixed in its parent body.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace mbdae {

// A body in the world: mass, centre of mass, and inertia about the centre by rows.
struct Body {
  double mass, centre[3], I[9];
};

class RneaPartials {
 public:
  // The parent (-1: none) and the degrees of freedom of each joint, parents first.
  RneaPartials(std::vector<int> parents, std::vector<std::vector<int>> dofs);

  void set(int joint, const Body& body);  // the body of a joint; a joint without one has no mass
  // Compute M (nv, nv) and nle(q, v), for J (6, nv) by columns, linear part first, about the point from which the
  // centres of bodies are given; gravity (3,) in m/s^2.
  void begin(const double* J, const double* gravity, const double* v, double* M, double* nle);
  // After `begin`: partials of M a + nle(q, v) with respect to q in the tangent and to v, (nv, nv) by rows; if
  // `inertia_only`, partials of M a for v = 0.
  void complete(const double* a, double* dtau_dq, double* dtau_dv, bool inertia_only);

 private:
  // Terms of a body or of the subtree of a joint: inertia (mass, first moment, and about the origin xx, xy, yy, xz, yz,
  // zz), momentum h = (p, L), wrench f, and S of the velocity-product matrix D w = (2 w x p, S w + w x L) for the
  // angular velocity w of the parent.
  struct InertiaTerms {
    double mass = 0, moment[3] = {}, I[6] = {};
    Six h{}, f{};
    double S[6] = {};

    void set_motion(const double* V, const double* A);
    void momentum(const double* x, double* out) const;  // for the motion x
    void add_D(const double* angular, double* out) const;
    void D_transposed(const double* x, double* angular) const;
  };
  // Terms of a degree of freedom; V and A are the motion of the parent.
  struct Column {
    Six J, IJ;
    double DJ[3];     // the angular part of D^T J; the linear one is 0
    Six psi_dot, psi_ddot;   // V x J, A x J + V x (V x J), as in the paper
    Six psi_dot_plus_S_dot;  // V x J plus the rate of J
  };

  void update_motion(int joint, const double* J, const double* v);

  const std::vector<int> parents_;
  const std::vector<std::vector<int>> dofs_;
  std::vector<std::vector<int>> ancestor_dofs_;  // degrees of freedom of all ancestors of each joint
  std::vector<InertiaTerms> bodies_, subtrees_;
  std::vector<bool> has_mass_;
  Six base_{};              // initial value of A: minus gravity
  std::vector<Six> V_, A_;  // velocity and acceleration of each joint; A for v' = 0
  std::vector<Six> Aa_, f_;  // contributions of a to A, and to the wrench of the subtree
  std::vector<Column> columns_;
};

}  // namespace mbdae
