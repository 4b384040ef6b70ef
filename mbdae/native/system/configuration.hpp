// A configuration q: the factorized mass matrix M = R R^T, R = U D^1/2, and the rows of G and Z = (R^-1 G^T)^T.
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

  void inertia(const double* q);                                        // M and its factors; G, Z become invalid
  void dynamics(const double* q, const double* v, bool with_partials);  // also nle, or terms of partials
  // M, and all rows of G and Z; with v also nle
  void evaluate(const double* q, bool counted, const double* v = nullptr);
  void scale_rows(const std::vector<int>& selected) { scale_rows(selected, G, Z); }     // Z of these rows
  void scale_rows(const std::vector<int>& selected, const Vector& G, Vector& Z) const;  // from another G
  void solve_root(double* x) const;                             // x := R^-1 x
  void solve_root_transposed(double* x) const;                        // x := R^-T x

  void mark_current(const double* q);       // M, G, g and Z are current at q
  void mark_rows_current(const double* q);  // G and g are current at q; Z has the factors of a configuration close to q
  void invalidate() { current_ = rows_current_ = false, ++stamp_; }
  long stamp() const { return stamp_; }                                          // changes when Z may change
  bool is_current(const double* q) const { return current_ && agrees_with(q); }  // to rounding
  bool are_rows_current(const double* q) const { return rows_current_ && agrees_with(q); }
  bool is_exactly_current(const double* q) const;  // exactly
  void exchange(Configuration& other);             // swap with another configuration of the mechanism

  Vector G, Z;       // entries by rows, see `Constraints::start`
  Vector g;          // (ng,) of all rows, without the motion of drivers
  Vector scratch_G;  // scratch of the same size

 private:
  void factorize();                         // factorize M
  bool agrees_with(const double* q) const;  // whether q is the stored configuration, to rounding

  MultibodyTree& m_;
  Constraints& constraints_;
  Counts& counts_;
  bool current_ = false, rows_current_ = false;
  long stamp_ = 0;
  Vector q_;          // (nq,) at which it is current
  Vector U_;          // D and U in the sparsity pattern of M
  Vector root_;       // (nv,) D^-1/2
  mutable Vector x_;  // (nv,) scratch
};

}  // namespace mbdae
