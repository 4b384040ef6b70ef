// The space of some rows of G M^-1/2, and the corrections of minimum norm that change their rates.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

class RowSpace {
 public:
  // Z (ng, nv): rows of G M^-1/2, of which `rows` may be dependent.
  RowSpace(const Index2System& s, const Vector& Z, const std::vector<int>& rows);

  size_t rank() const { return pivots_.size(); }
  void project_out(Vector& x) const;  // x (nv,): its part orthogonal to the rows
  // The x of minimum norm with Z x = rates (ng,) for these rows; the rates are consistent.
  Vector minimum_norm_correction(const Vector& rates) const;
  // Coefficients (ng,) of the rows that add up to x, of minimum norm in characteristic lengths.
  Vector multipliers(const Vector& x) const;

 private:
  const Index2System& s_;
  const Vector& Z_;
  const std::vector<int> rows_;
  std::vector<int> pivots_;      // independent rows
  std::vector<Vector> basis_;    // orthonormal, (nv,) each
  std::vector<Vector> factors_;  // of the pivots by this basis
};

}  // namespace mbdae
