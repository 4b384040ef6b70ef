// The row space of some rows of G M^-1/2, and minimum-norm corrections of their rates.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

class RowSpace {
 public:
  // Z (ng, nv): G M^-1/2; `rows` may be dependent.
  RowSpace(const Index2System& s, const Vector& Z, const std::vector<int>& rows);

  size_t rank() const { return pivots_.size(); }
  void project_out(Vector& x) const;  // subtract from x (nv,) its projection onto the row space
  // The minimum-norm x with Z x = rates (ng,) for these rows, whose rates are consistent.
  Vector minimum_norm_correction(const Vector& rates) const;
  // The multipliers (ng,) of minimum norm in characteristic lengths for which the rows sum to x.
  Vector multipliers(const Vector& x) const;

 private:
  const Index2System& s_;
  const Vector& Z_;
  const std::vector<int> rows_;
  std::vector<int> pivots_;      // independent rows
  std::vector<Vector> basis_;    // orthonormal, (nv,) each
  std::vector<Vector> factors_;  // coefficients of the pivot rows in this basis
};

}  // namespace mbdae
