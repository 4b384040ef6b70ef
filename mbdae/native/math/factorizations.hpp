// Linear algebra on arrays: banded LU, pivoted QR for the selection of independent rows, least squares.
#pragma once

#include <vector>

namespace mbdae {

using Vector = std::vector<double>;

// LU of a banded matrix with partial pivoting; a full matrix is a band as wide as the matrix.
class BandLU {
 public:
  void resize(int n, int half_bandwidth);  // set the size, fill with zeros
  void zero();
  double& at(int i, int j) { return a_[i * width_ + j - i + half_bandwidth_]; }
  bool factorize();  // false if a pivot is zero or not finite
  void solve(double* b) const;
  void solve_transposed(double* b) const;
  double pivot_ratio() const { return ratio_; }  // smallest to largest pivot
  int half_bandwidth() const { return half_bandwidth_; }

 private:
  int n_ = 0, half_bandwidth_ = 0, width_ = 1;
  double ratio_ = 1;
  std::vector<double> a_, multiplier_;
  std::vector<int> swap_;
};

// Householder QR with column pivoting of B (m, n), by columns, in place: the order of the columns and |diag R|,
// decreasing. B grows by min(m, n) numbers.
void pivoted_qr(int m, int n, Vector& B, std::vector<int>& order, Vector& diagonal);

// The minimum-norm z (m,) that minimizes |B^T z - r|, B (m, n) by columns; `truncation` determines its numerical rank.
void minimum_norm(int m, int n, const double* B, const double* r, double truncation, double* z);

// The X (n, k) that minimizes |A X - B|, A (m, n) of full rank, all by columns: written to the first n rows of B (m, k).
void least_squares(int m, int n, double* A, int k, double* B);

}  // namespace mbdae
