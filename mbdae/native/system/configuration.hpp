// A configuration: the factorized mass matrix M = U D U^T, and the rows of G and of Z = (D^-1/2 U^-1 G^T)^T.
#pragma once

#include <vector>

#include "mechanism/rows.hpp"

namespace mbdae {

struct Counts {
  long f = 0, M = 0, G = 0, solves = 0, factorizations = 0, newton = 0, projections = 0, state_projections = 0;
};

class Configuration {
 public:
  Configuration(Mechanics& m, Constraints& constraints, Counts& counts);

  void inertia(const double* q);                                // M, its factors; G, Z invalid
  void dynamics(const double* q, const double* v, bool with_partials);  // and nle; or the first terms of partials
  void evaluate(const double* q, bool counted);                 // all of it, over all rows
  void scale(int row) { scale(row, G, Z); }                     // Z of a row, from G
  void scale(int row, const Numbers& G, Numbers& Z) const;      // the same of other rows (ng, nv)
  void half(double* x) const;                                   // x := D^-1/2 U^-1 x
  void half(double* x, const std::vector<int>& columns) const;  // the same where x is zero elsewhere
  void back(double* x) const;                                   // x := U^-T D^-1/2 x

  void stand(const double* q);  // mark all of it as current at q
  void forget() { stands_ = false, ++stamp_; }
  long stamp() const { return stamp_; }  // changes whenever Z may change
  bool near(const double* q) const;     // is it current at q, to rounding?
  bool exactly(const double* q) const;  // is it current at exactly q?
  void exchange(Configuration& other);          // with another configuration of the same mechanism

  Numbers G, Z;  // (ng, nv) by rows
  Numbers g;     // (ng,) over all rows, without the motion of drivers
  Numbers other_G;  // (ng, nv) scratch, zero outside the columns of rows

 private:
  void factorize();  // M

  Mechanics& m_;
  Constraints& constraints_;
  Counts& counts_;
  bool stands_ = false;
  long stamp_ = 0;
  Numbers q_;     // (nq,) where it is current
  Numbers U_;     // (nv, nv) by columns: above the diagonal, U
  Numbers root_;  // (nv,) D^-1/2
};

}  // namespace mbdae
