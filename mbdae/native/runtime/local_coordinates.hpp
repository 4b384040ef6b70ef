// Local coordinates x = (xi, eta, s) of the states near a consistent state, and the ordinary differential equation in
// them (mbdae/mechanism/equations/local_coordinates.py, local_ode.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

struct CoordinateLimits {  // thresholds of Python, under the same names
  int iterations = 0, halvings = 0;
  double largest_step = 0, closed = 0, smallest_cosine = 0, largest_rotation = 0, gamma_width = 0;
  double restart_margin = 0;  // below which other coordinates are due

  FIELDS(iterations, halvings, largest_step, closed, smallest_cosine, largest_rotation, gamma_width,
         restart_margin)
};

class LocalCoordinates {
 public:
  LocalCoordinates(Index2System& s, const CoordinateLimits& limits, double t, const double* y);  // origin y (length,)

  int size() const { return k_ + f_ + s_.ns; }
  const Vector& origin() const { return x0_; }  // (size,) the same state in these coordinates

  void state(double t, const double* x, double* y);              // y (length,), work 0; displacement `moved`
  void rate(double t, const double* x, double* y, double* dx);   // the same, and x'
  const Vector& F() const { return F_; }                         // (ny,) y' of the last call of `rate`
  const Vector& multipliers() const { return z_; }               // (ng,) lam there
  // How far the state of the last call is inside the range: 1 at the origin, 0 at the end.
  double margin() const { return margin_; }
  // d/d(x, m inputs) at x: of the tangent of y (ny, size), of F = y' (ny, size + m), of x' (size, size + m), and of lam
  // of the rows in use, (ng, size + m); by rows. inputs: sets the input i to its value plus a change.
  struct Partials {
    Vector y, F, x, lam, raw;  // raw: of q itself, (nq, size)
  };
  template <class SetInput>
  void partials(double t, const double* x, int inputs, const SetInput& set_input, Partials& out) {
    begin_partials(t, x, out, inputs);
    Vector up, down;
    for (int i = 0; i < inputs; ++i) {
      set_input(i, 1.0), forces(t, up), set_input(i, -1.0), forces(t, down), set_input(i, 0.0);
      for (size_t j = 0; j < up.size(); ++j) up[j] = (up[j] - down[j]) / 2;
      right_.push_back(up);
    }
    complete_partials(inputs, out);
  }

 private:
  bool is_off(int row) const { return !s_.constraints.off.empty() && s_.constraints.off[row]; }
  void position(double t, const double* xi);
  bool corrected(double t, const Vector& xi, Vector& mu);
  void displacement(const Vector& xi, const Vector& mu);
  void evaluate_rows(double t, const double* q);              // G_, g_ over all rows
  void velocities(Vector& columns, int n) const;              // J(x)^-1 of columns (n, nv)
  void begin_partials(double t, const double* x, Partials& out, int inputs);
  void complete_partials(int inputs, Partials& out);
  void forces(double t, Vector& out);          // f and rates at the point of partials
  Vector gamma_by_q(const Vector& direction);  // derivative of gamma, (ng,)
  Vector gamma(const double* q, const double* v);

  Index2System& s_;
  const CoordinateLimits limits_;
  std::vector<int> positional_;
  Vector q0_, across_, N_, Nv_;  // columns (r, nv), (k, nv), (f, nv), of coordinates in their scales
  int r_ = 0, k_ = 0, f_ = 0;
  Vector x0_;
  double last_t_;
  Vector last_xi_, last_mu_, first_xi_, first_mu_;
  double first_t_;
  Vector moved_, q_, g_, G_, y_, F_, z_;
  double t_ = 0, margin_ = 1;
  EquationPartials at_;
  std::vector<Vector> right_;  // columns of the right-hand side of (v', rates)
  Vector below_, dx_;          // (n, r) of 0 = G v' + gamma, and of the displacement, (size, nv)
};

// X (n, k) of consistent equations A X = B, A (m, n) of full rank, by least squares and one refinement; by columns.
Vector solved(const Vector& A, const Vector& B, size_t m, size_t n);

}  // namespace mbdae
