// A configuration: the factorized mass matrix M = R R^T, R = U D^1/2, and the rows of G and of Z = (R^-1 G^T)^T.
#pragma once

#include <vector>

#include "mechanism/rows.hpp"

namespace mbdae {

struct Counts {
  long f = 0, M = 0, G = 0, solves = 0, factorizations = 0, newton = 0, projections = 0, state_projections = 0;
};

class Configuration {
 public:
  Configuration(MultibodyTree& m, Constraints& constraints, Counts& counts);

  void inertia(const double* q);                                // M, its factors; G, Z invalid
  void dynamics(const double* q, const double* v, bool with_partials);  // and nle; or the first terms of partials
  void evaluate(const double* q, bool counted);                 // all of it, over all rows
  void scale_rows(const std::vector<int>& which) { scale_rows(which, G, Z); }  // Z of these rows, from G
  void scale_rows(const std::vector<int>& which, const Vector& G, Vector& Z) const;  // the same of other G
  void solve_root(double* x) const;                             // x := R^-1 x
  void solve_root_transposed(double* x) const;                        // x := R^-T x

  void mark_current(const double* q);  // all of it is current at q from now on
  void mark_rows_current(const double* q);  // G and g are, with Z of the factors at a configuration nearby
  void invalidate() { current_ = rows_current_ = false, ++stamp_; }
  long stamp() const { return stamp_; }  // changes whenever Z may change
  bool is_current(const double* q) const { return current_ && is_near(q); }  // is it current at q, to rounding?
  bool are_rows_current(const double* q) const { return rows_current_ && is_near(q); }
  bool is_exactly_current(const double* q) const;  // is it current at exactly q?
  void exchange(Configuration& other);          // with another configuration of the same mechanism

  Vector G, Z;       // entries by rows, see `Constraints::start`
  Vector g;          // (ng,) over all rows, without the motion of drivers
  Vector scratch_G;  // scratch of the same size

 private:
  void factorize();  // M
  bool is_near(const double* q) const;  // the current configuration, to rounding

  MultibodyTree& m_;
  Constraints& constraints_;
  Counts& counts_;
  bool current_ = false, rows_current_ = false;
  long stamp_ = 0;
  Vector q_;          // (nq,) where it is current
  Vector U_;          // by the tree as M: pivots, and the entries of U
  Vector root_;       // (nv,) D^-1/2
  mutable Vector x_;  // (nv,) scratch
};

}  // namespace mbdae
