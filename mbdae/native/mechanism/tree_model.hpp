// The data of a tree, and the interface of algorithms for joints that the sweep (tree_sweep.hpp) does not support. The
// source of models depends on the program: Pinocchio (pinocchio_tree.cpp), or data of an exported mechanism (runtime/).
#pragma once

#include <memory>
#include <vector>

#include "mechanism/tree_sweep.hpp"

namespace mbdae {

struct TreeModel {
  struct Joint {  // a joint and its child body, with pointers into the model, as in TreeJoint
    int parent = 0, iq = 0, iv = 0, nv = 0;
    const double *R = nullptr, *p = nullptr;                       // placement on the parent, by columns
    const double *mass = nullptr, *lever = nullptr, *I = nullptr;  // as in TreeJoint
  };
  int nq = 0, nv = 0;
  std::vector<Joint> joints;    // parents first, after the world
  std::vector<TreeJoint> tree;  // as joints with fixed axes; empty: a joint is unsupported
  const double *gravity = nullptr, *armature = nullptr;  // (3,), (nv,)
};

// Algorithms of trees with joints that the sweep does not support.
class TreeAlgorithms {
 public:
  virtual ~TreeAlgorithms() = default;

  // M (nv, nv) by columns, above the diagonal
  virtual const double* inertia(const double* q, double* poses, double* J) = 0;
  virtual void poses(const double* q, double* poses, double* J) = 0;
  virtual void motions(const double* q, const double* v, const double* a, double* poses) = 0;  // a = nullptr: 0
  virtual void bias(const double* q, const double* v, double* nle) = 0;
  virtual void inverse(const double* q, const double* v, const double* a, double* poses, double* J, double* out) = 0;
  virtual void velocity(int joint, const double* poses, double* out) const = 0;
  virtual void acceleration(int joint, const double* poses, double* out) const = 0;
  virtual void bias_minus_gravity(int joint, const double* poses, double* out) const = 0;
  virtual void integrate(const double* q, const double* x, double* out) = 0;
  virtual void difference(const double* q0, const double* q1, double* out) = 0;
  virtual void neutral(double* q) = 0;
  virtual void normalize(double* q) = 0;
  virtual void tangent_map(const double* q, const double* v, double* dq) = 0;
};

TreeModel tree_model(const void* model);
std::unique_ptr<TreeAlgorithms> tree_algorithms(const void* model);  // std::invalid_argument: not available

}  // namespace mbdae
