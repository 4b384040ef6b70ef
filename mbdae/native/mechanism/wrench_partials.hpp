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
  void damp();                                    // set C = 0, to be added to
  // Da of a wrench of the frames and V = V_b - V_a alone: a motion d of both frames with their velocities changes it by
  // d x* F, so that Da + Db - C (V x .) = F*.
  void complete(const double* V = nullptr);

  double F[6], Da[36], Db[36], C[36];
  bool damped;  // C is not 0
};

// Contributions of the columns of J that move only one frame of a pair, at a point. Outputs have rows of `width`.
class PairPartials {
 public:
  // J and poses are current, the pair is located; v is null if no torque is damped.
  PairPartials(const MultibodyTree& m, const Pair& pair, const double* v);

  const Pair& pair;
  const int nv;
  double V[6];  // V_b - V_a

  void torque(const WrenchPartials& t, double* K, size_t width) const;    // K += d(J^T F)/dq
  void damping(const double* C, double* D, size_t width) const;           // D += d(J^T F)/dv
  void power(const double* w, const WrenchPartials& t, double* B) const;  // B += d(w . (V_b - V_a))/dq

 private:
  struct Column {
    int at, joint;  // of the expanded tree
    double sign;
    const double* J;
    double dV[6];
  };
  void add_node(const MultibodyTree& m, int frame, double sign, const double* v);

  std::vector<Column> columns_;
  struct Turn {  // of a node: dT_k/dq_m + dW_k/dq_m - W_m x W_k, of the columns T and W of its modes
    int k, m;
    double sign, change[6];
  };
  std::vector<Turn> node_changes_;
  std::vector<std::vector<double>> split_;  // of each node: columns of translation and of rotation
};

void matrix_of_wrench(const double* F, double* out);  // d -> d x* F
void times6(const double* D, const double* x, double* out);
void moved_line_partials(const double* p, const double* n, double* D);       // D += d(n, p x n)/dp, n fixed
void distance_partials(const Pair& pair, double factor, WrenchPartials& t);  // of factor times a distance's wrench

}  // namespace mbdae
