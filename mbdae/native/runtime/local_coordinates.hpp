// Local coordinates x = (xi, eta, s) of the states near a consistent state, and the ordinary differential equation in
// them (mbdae/mechanism/equations/local_coordinates.py, local_ode.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

struct CoordinateLimits {  // thresholds with the names of Python
  int iterations = 0, halvings = 0;
  double largest_step = 0, closed = 0, smallest_cosine = 0, largest_rotation = 0, gamma_width = 0;
  double restart_margin = 0;  // a smaller margin requires new coordinates

  FIELDS(iterations, halvings, largest_step, closed, smallest_cosine, largest_rotation, gamma_width,
         restart_margin)
};

class LocalCoordinates {
 public:
  LocalCoordinates(Index2System& s, const CoordinateLimits& limits, double t, const double* y);  // origin y (length,)

  int size() const { return k_ + f_ + s_.ns; }
  const Vector& origin() const { return x0_; }  // (size,) the origin in these coordinates

  void state(double t, const double* x, double* y);              // y (length,), with zero work
  void rate(double t, const double* x, double* y, double* dx);   // also x'
  const Vector& F() const { return F_; }                         // (ny,) y' of the last call of `rate`
  const Vector& multipliers() const { return z_; }               // (ng,) lam of the last call of `rate`
  // Distance of the last state from the limit of the coordinates: 1 at the origin, 0 at the limit.
  double margin() const { return margin_; }
  // Partials with respect to x and m inputs, by rows: of y in the tangent (ny, size), of F = y' (ny, size + m), of x'
  // (size, size + m), and of lam of the rows in use, (ng, size + m). set_input(i, change) changes input i by `change`.
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
      force_rhs_.push_back(up);
    }
    complete_partials(inputs, out);
  }

 private:
  bool is_inactive(int row) const { return !s_.constraints.inactive.empty() && s_.constraints.inactive[row]; }
  void position(double t, const double* xi);
  bool project(double t, const Vector& xi, Vector& mu);
  void set_displacement(const Vector& xi, const Vector& mu);
  void evaluate_rows(double t, const double* q);              // G_, g_ of all rows
  void velocities(Vector& columns, int n) const;              // J(x)^-1 of columns (n, nv)
  void begin_partials(double t, const double* x, Partials& out, int inputs);
  void complete_partials(int inputs, Partials& out);
  void forces(double t, Vector& out);                // forces and rates at the point of the partials
  Vector gamma_derivative(const Vector& direction);  // derivative of gamma, (ng,)
  Vector gamma(const double* q, const double* v);

  Index2System& s_;
  const CoordinateLimits limits_;
  std::vector<int> positional_;
  Vector q0_, normals_, N_, Nv_;  // bases (r, nv), (k, nv), (f, nv) in scaled coordinates
  int r_ = 0, k_ = 0, f_ = 0;
  Vector x0_;
  double last_t_;
  Vector last_xi_, last_mu_, first_xi_, first_mu_;
  double origin_t0_;
  Vector displacement_, q_, g_, G_, y_, F_, z_;
  double t_ = 0, margin_ = 1;
  EquationPartials partials_;
  std::vector<Vector> force_rhs_;  // columns of the right-hand side of (v', rates)
  Vector constraint_rhs_, dx_;     // (n, r) of 0 = G v' + gamma; partials of the displacement, (size, nv)
};

// The solution X (n, k) of consistent equations A X = B, A (m, n) of full rank, by columns: least squares with one step
// of iterative refinement.
Vector solve_refined(const Vector& A, const Vector& B, size_t m, size_t n);

}  // namespace mbdae
