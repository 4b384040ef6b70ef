// LU with partial pivoting of real or complex full matrices, for the systems of implicit methods.
#pragma once

#include <cstddef>
#include <vector>

#include "math/factorizations.hpp"

namespace mbdae {

// Stored by columns; a complex column (components = 2) has its n real parts first, then its n imaginary parts. Vectors
// have the same layout.
template <int components>
class DenseLU {
 public:
  void resize(int n);  // set the size, fill with zeros
  double* column(int j) { return &a_[static_cast<std::size_t>(j) * components * n_]; }
  int size() const { return n_; }
  bool factorize();  // false if a pivot is zero or not finite
  void solve(double* b) const;
  void solve_transposed(double* b) const;
  bool positive_determinant() const;  // for a real matrix

 private:
  int n_ = 0;
  Vector a_;  // the factors, with 1 / pivot on the diagonal
  std::vector<int> swap_;
};

extern template class DenseLU<1>;
extern template class DenseLU<2>;

}  // namespace mbdae
