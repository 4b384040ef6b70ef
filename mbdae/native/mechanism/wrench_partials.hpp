// How wrenches between two frames, and their power, change with q and v (mbdae/mechanism/wrench_partials.py). Matrices
// (6, 6) by rows.
#pragma once

#include <vector>

#include "mechanism/rows.hpp"
#include "math/spatial.hpp"

namespace mbdae {

// A wrench F (6,) on frame b and -F on a: dF = Da d_a + Db d_b + C d(V_b - V_a) for motions d of the frames.
struct WrenchPartials {
  WrenchPartials() { clear(); }
  void clear();  // to zero
  void add(double factor, const WrenchPartials& other);  // not damped
  void damp();                                    // C is 0 from here on, and counts

  double F[6], Da[36], Db[36], C[36];
  bool damped;  // C is not 0
};

// What the columns of J that move one frame of a pair alone do at a point. Matrices to add to have rows of `width`.
class PairPartials {
 public:
  // J and poses stand, the pair is located; without v for torques that are not damped alone.
  PairPartials(const Mechanics& m, const Pair& pair, const double* v);

  const Pair& pair;
  const int nv;
  double V[6];  // V_b - V_a

  void torque(const WrenchPartials& t, double* K, size_t width) const;          // K += slopes of J^T F by q
  void damping(const double* C, double* D, size_t width) const;          // D += slopes of J^T F by v
  void power(const double* w, const WrenchPartials& t, double* B) const;        // B += slopes of w . (V_b - V_a) by q

 private:
  struct Column {
    int at, part;
    double sign;
    const double* J;
    double dV[6];
  };
  std::vector<Column> columns_;
};

void matrix_of_wrench(const double* F, double* out);  // d -> d x* F
void times6(const double* D, const double* x, double* out);
void carried(const double* p, const double* n, double* D);  // D += slopes of (n, p x n), n held, when p moves
void line_slopes(const Pair& pair, double factor, WrenchPartials& t);  // of factor times the unit wrench along a distance

}  // namespace mbdae
