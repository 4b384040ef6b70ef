// Partials of wrenches between two frames, and of their power, with respect to q and v
// (mbdae/mechanism/tree/wrench_partials.py). Matrices (6, 6) by rows.
#pragma once

#include <vector>

#include "mechanism/rows.hpp"
#include "math/spatial.hpp"

namespace mbdae {

// A wrench F (6,) on frame b and -F on a: dF = Da d_a + Db d_b + C d(V_b - V_a) for motions d of the frames.
struct WrenchPartials {
  WrenchPartials() { clear(); }
  void clear();  // set to zero
  void add(double factor, const WrenchPartials& other);  // without damping
  void damp();                                           // set C = 0, before terms are added
  // Set Da of a wrench that depends only on the frames and V = V_b - V_a: a common motion d of both frames changes it
  // by d x* F, so that (Da + Db) d = d x* F + C (V x d).
  void complete(const double* V = nullptr);

  double F[6], Da[36], Db[36], C[36];
  bool damped;  // C is not 0
};

// Partials of J^T F by the columns of J that move only one frame of a pair. Rows of outputs have `width` entries.
class PairPartials {
 public:
  // J, poses and the frames of the pair must be current; v may be null if no wrench is damped.
  PairPartials(const MultibodyTree& m, const Pair& pair, const double* v);

  const Pair& pair;
  const int nv;
  double V[6];  // V_b - V_a

  void generalized_force(const WrenchPartials& t, double* K, size_t width) const;    // K += d(J^T F)/dq
  void damping(const double* C, double* D, size_t width) const;           // D += d(J^T F)/dv
  void power(const double* w, const WrenchPartials& t, double* B) const;  // B += d(w . (V_b - V_a))/dq

 private:
  struct Column {
    int velocity, joint;  // index in v; joint of the expanded tree
    double sign;
    const double* J;
    double dV[6];
  };
  void add_node(const MultibodyTree& m, int frame, double sign, const double* v);

  std::vector<Column> columns_;
  struct NodeChange {  // dT_k/dq_m + dW_k/dq_m - W_m x W_k of a node, T and W: columns of its modes
    int k, m;
    double sign, change[6];
  };
  std::vector<NodeChange> node_changes_;
  std::vector<std::vector<double>> split_;  // columns of translation and rotation of each node
};

void matrix_of_wrench(const double* F, double* out);  // d -> d x* F
void times6(const double* D, const double* x, double* out);
void line_point_partials(const double* p, const double* n, double* D);  // D += d(n, p x n)/dp for constant n
// add the partials of the wrench of a distance row, times `factor`
void distance_partials(const Pair& pair, double factor, WrenchPartials& t);

}  // namespace mbdae
