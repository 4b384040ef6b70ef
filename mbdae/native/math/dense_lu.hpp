// LU with partial pivoting of real or complex matrices, for the systems of implicit methods.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "math/factorizations.hpp"

namespace mbdae {

// Stored by columns; a complex column (components = 2) has its n real parts first, then its n imaginary parts. Vectors
// have the same layout. A large matrix with few entries is factorized in an order of its unknowns that gives it a narrow
// band, in linear time.
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
  bool find_band();  // set the order and the band if they save work; false if an entry is not finite
  bool eliminate();
  void solve_factors(double* b) const;
  void solve_factors_transposed(double* b) const;
  template <class Solve>
  void in_order(double* b, Solve&& solve) const;  // solve with the entries of b in order
  double* factor(int j) { return (position_.empty() ? a_.data() : band_.data()) + j * step_ + shift_; }  // by row
  const double* factor(int j) const { return const_cast<DenseLU*>(this)->factor(j); }
  int last_row(int column) const { return std::min(n_, column + lower_); }  // end of the rows of L
  int last_column(int row) const { return std::min(n_, row + upper_); }     // end of the columns of U

  int n_ = 0;
  Vector a_;                       // the matrix; of a full one the factors, with 1 / pivot on the diagonal
  std::vector<int> swap_;          // rows of pivots: within a panel, columns of L are swapped, too
  std::vector<int> position_;      // of the unknowns in the band; empty: full
  Vector band_;                    // the factors, by columns
  int lower_ = 0, upper_ = 0;      // widths of the band of L and U
  int stride_ = 0;                 // between real and imaginary parts of a column
  std::size_t step_ = 0, shift_ = 0;  // from column to column; of the first row of a column
};

extern template class DenseLU<1>;
extern template class DenseLU<2>;

}  // namespace mbdae
