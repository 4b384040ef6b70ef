// What the core asks of Pinocchio, in plain numbers: mechanics.cpp alone sees its types.
#pragma once

#include <memory>
#include <vector>

#include "mechanism/rnea_partials.hpp"
#include "math/tolerances.hpp"

namespace mbdae {

class Mechanics {
 public:
  // model points to a pinocchio::Model that outlives this object.
  Mechanics(const void* model, const Tolerances& limits);
  ~Mechanics();

  const Tolerances limits;
  int nq, nv, joints;
  std::vector<std::vector<int>> ancestors;  // of each degree of freedom, nearest first
  std::vector<int> tangent;                 // (nq,) the degree of freedom of a joint's first coordinate
  std::vector<int> parents;                 // (joints,)
  std::vector<int> parts;                   // (nv,) of each degree of freedom: its joint in the expanded tree

  std::vector<std::vector<int>> supports() const;  // of each joint: the degrees of freedom that move it

  void inertia(const double* q);                                  // M; J and poses in the world
  void inertia(const double* q, const double* v);                 // alike, with what `slopes` there begins with
  const double* bias() const;                                     // (nv,) nle there
  void poses(const double* q);                                    // J and poses alone
  void keep();                                                    // poses, for `back`; others are to be asked for next
  void back();                                                    // to the poses that were kept
  void motions(const double* q, const double* v);                 // velocities, and accelerations for v' = 0
  void motions(const double* q, const double* v, const double* a);  // and accelerations for v' = a
  void bias(const double* q, const double* v, double* out);       // nle(q, v); velocities, and what `falling` gives
  void inverse(const double* q, const double* v, const double* a, double* out);  // M a + nle(q, v); J and poses

  // model points to the expanded tree (mechanism/expanded_tree.py).
  void expand(const void* model);
  bool expanded() const { return !parts.empty(); }
  // Slopes of M a + nle(q, v) by q in the tangent and by v, (nv, nv) by rows; of M a `alone` where v = 0. M, J and poses
  // stand then.
  void slopes(const double* q, const double* v, const double* a, double* by_q, double* by_v, bool alone = false);

  void integrate(const double* q, const double* x, double* out);  // q (+) x
  void difference(const double* q0, const double* q1, double* out);
  void neutral(double* q);
  void normalize(double* q);
  void tangent_map(const double* q, const double* v, double* dq);  // dq/dt of raw coordinates

  // Seconds of one crba, nle, Cholesky factorization of M and solve of the saddle-point system with G (r, nv) by rows,
  // all with the routines of Pinocchio and Eigen: what a stage cannot do without.
  double bare(const double* q, const double* v, int r, const double* G, int repetitions);

  double potential() const;                 // of gravity in J, where poses stand
  const double* M() const;                  // upper triangle by columns, (nv, nv); behind `slopes` all of it
  const double* J() const;                  // at the world's origin by columns, (6, nv)
  const double* rotation(int joint) const;  // by columns
  const double* position(int joint) const;
  void velocity(int joint, double* out) const;  // spatial, at the world's origin, linear part first
  void acceleration(int joint, double* out) const;
  long motion() const { return motion_; }  // another one where velocities or accelerations may be others
  long placed() const { return placed_; }  // another one where poses may be others
  void falling(int joint, double* out) const;  // acceleration less gravity for v' = 0, where `bias` was called last
  void gravity(double* out) const;                              // (3,)
  void place(int joint, double* R, double* p) const;            // of the joint's own place on the body before it, by rows
  Body body(int joint) const;                                   // behind a joint

 private:
  struct Workspace;
  bool stands(const double* q, const double* v) const;  // are slopes begun there?

  std::unique_ptr<Workspace> w;
  long motion_ = 0, placed_ = 0;
};

}  // namespace mbdae
