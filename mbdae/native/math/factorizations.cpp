// Banded LU, column-pivoted QR, minimum-norm and least-squares solutions.
#include "math/factorizations.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace mbdae {

void BandLU::resize(int n, int half_bandwidth) {
  n_ = n, half_bandwidth_ = std::max(0, std::min(half_bandwidth, n - 1)), width_ = 3 * half_bandwidth_ + 1;
  a_.assign(static_cast<size_t>(n) * width_, 0.0);
  multiplier_.assign(static_cast<size_t>(n) * std::max(half_bandwidth_, 1), 0.0);
  swap_.assign(n, 0);
}

void BandLU::zero() { std::fill(a_.begin(), a_.end(), 0.0); }

bool BandLU::factorize() {
  const int row_stride = width_ - 1;  // from an entry to that of the next row, in the same column
  double smallest = INFINITY, largest = 0;
  for (int k = 0; k < n_; ++k) {
    const int remaining = n_ - 1 - k, below = std::min(half_bandwidth_, remaining),
              right = std::min(2 * half_bandwidth_, remaining);
    double* __restrict top = &a_[k * width_ + half_bandwidth_];
    double pivot = std::fabs(*top);
    int p = 0;
    for (int i = 1; i <= below; ++i)
      if (const double size = std::fabs(top[i * row_stride]); size > pivot) pivot = size, p = i;
    swap_[k] = k + p;
    if (p)
      for (int j = 0; j <= right; ++j) std::swap(top[j], top[p * row_stride + j]);
    if (!(pivot > 0) || !std::isfinite(pivot)) return ratio_ = 0, false;
    smallest = std::min(smallest, pivot), largest = std::max(largest, pivot);
    double *row = top, *multiplier = &multiplier_[k * half_bandwidth_];
    for (int i = 1; i <= below; ++i) {
      row += row_stride;
      const double f = *multiplier++ = row[0] / top[0];
      if (f != 0)
        for (int j = 1; j <= right; ++j) row[j] -= f * top[j];
    }
  }
  ratio_ = n_ ? smallest / largest : 1;
  return true;
}

void BandLU::solve(double* __restrict b) const {
  const double* multiplier = multiplier_.data();
  for (int k = 0; k < n_; ++k, multiplier += half_bandwidth_) {
    if (swap_[k] != k) std::swap(b[k], b[swap_[k]]);
    const int below = std::min(half_bandwidth_, n_ - 1 - k);
    const double f = b[k];
    for (int i = 1; i <= below; ++i) b[k + i] -= multiplier[i - 1] * f;
  }
  for (int k = n_ - 1; k >= 0; --k) {
    const double* row = &a_[k * width_ + half_bandwidth_];
    const int right = std::min(2 * half_bandwidth_, n_ - 1 - k);
    double s = b[k];
    for (int j = 1; j <= right; ++j) s -= row[j] * b[k + j];
    b[k] = s / row[0];
  }
}

void BandLU::solve_transposed(double* b) const {
  for (int k = 0; k < n_; ++k) {
    for (int i = std::max(0, k - 2 * half_bandwidth_); i < k; ++i) b[k] -= a_[i * width_ + half_bandwidth_ + k - i] * b[i];
    b[k] /= a_[k * width_ + half_bandwidth_];
  }
  for (int k = n_ - 1; k >= 0; --k) {
    const int below = std::min(k + half_bandwidth_, n_ - 1);
    for (int i = k + 1; i <= below; ++i) b[k] -= multiplier_[k * half_bandwidth_ + i - k - 1] * b[i];
    if (swap_[k] != k) std::swap(b[k], b[swap_[k]]);
  }
}

namespace {

// Column-pivoted Householder QR in place: R above the diagonal, reflectors below, with their first entries in `head`.
void qr(int m, int n, double* A, std::vector<int>& order, std::vector<double>& diagonal, double* head) {
  order.resize(n);
  std::iota(order.begin(), order.end(), 0);
  const int steps = std::min(m, n);
  diagonal.assign(steps, 0.0);
  for (int k = 0; k < steps; ++k) {
    int pivot_column = k;
    double largest_square = -1;
    for (int j = k; j < n; ++j) {
      double s = 0;
      for (int i = k; i < m; ++i) s += A[j * m + i] * A[j * m + i];
      if (s > largest_square) largest_square = s, pivot_column = j;
    }
    if (pivot_column != k) {
      std::swap_ranges(A + k * m, A + (k + 1) * m, A + pivot_column * m);
      std::swap(order[k], order[pivot_column]);
    }
    double* x = A + k * m;
    const double norm = std::sqrt(largest_square);
    diagonal[k] = norm;
    head[k] = 0;
    if (!(norm > 0)) continue;
    const double alpha = x[k] > 0 ? -norm : norm;
    const double u0 = x[k] - alpha;  // the reflector is I - u u^T / beta, u = (u0, x below)
    const double beta = norm * std::fabs(u0);
    for (int j = k + 1; j < n; ++j) {
      double* y = A + j * m;
      double s = u0 * y[k];
      for (int i = k + 1; i < m; ++i) s += x[i] * y[i];
      s /= beta;
      y[k] -= s * u0;
      for (int i = k + 1; i < m; ++i) y[i] -= s * x[i];
    }
    x[k] = alpha, head[k] = u0;
  }
}

// Apply the reflectors of qr to y, first to last (Q^T y) or last to first (Q y).
void reflect(int m, int r, const double* A, const double* head, double* y, bool transpose) {
  for (int s = 0; s < r; ++s) {
    const int k = transpose ? s : r - 1 - s;
    const double* x = A + k * m;
    if (head[k] == 0) continue;
    const double beta = std::fabs(x[k]) * std::fabs(head[k]);
    double d = head[k] * y[k];
    for (int i = k + 1; i < m; ++i) d += x[i] * y[i];
    d /= beta;
    y[k] -= d * head[k];
    for (int i = k + 1; i < m; ++i) y[i] -= d * x[i];
  }
}

}  // namespace

void pivoted_qr(int m, int n, Vector& B, std::vector<int>& order, Vector& diagonal) {
  B.resize(static_cast<size_t>(m) * n + std::min(m, n));
  qr(m, n, B.data(), order, diagonal, B.data() + static_cast<size_t>(m) * n);
}

void minimum_norm(int m, int n, const double* B, const double* r, double truncation, double* z) {
  // B P = Q [R1; 0], R1 (k, n): z = Q1 w with R1^T w = P^T r in the least-squares sense, by a second QR of R1^T.
  std::vector<double> A(B, B + static_cast<size_t>(m) * n), head(std::min(m, n)), diagonal, d2;
  std::vector<int> order, o2;
  qr(m, n, A.data(), order, diagonal, head.data());
  int k = 0;
  while (k < static_cast<int>(diagonal.size()) && diagonal[k] > truncation * diagonal[0]) ++k;
  std::vector<double> T(static_cast<size_t>(n) * k, 0.0), h2(std::max(k, 1)), b(n), w(m, 0.0);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < std::min(k, j + 1); ++i) T[i * n + j] = A[j * m + i];
  for (int j = 0; j < n; ++j) b[j] = r[order[j]];
  qr(n, k, T.data(), o2, d2, h2.data());
  reflect(n, k, T.data(), h2.data(), b.data(), true);
  for (int i = k - 1; i >= 0; --i) {
    for (int j = i + 1; j < k; ++j) b[i] -= T[j * n + i] * b[j];
    b[i] /= T[i * n + i];
  }
  for (int i = 0; i < k; ++i) w[o2[i]] = b[i];
  reflect(m, k, A.data(), head.data(), w.data(), false);
  std::copy(w.begin(), w.end(), z);
}

void least_squares(int m, int n, double* A, int k, double* B) {
  Vector head(n), diagonal, x(n);
  std::vector<int> order;
  qr(m, n, A, order, diagonal, head.data());
  for (double* b = B; b < B + static_cast<size_t>(m) * k; b += m) {
    reflect(m, n, A, head.data(), b, true);
    for (int i = n - 1; i >= 0; --i) {
      for (int j = i + 1; j < n; ++j) b[i] -= A[j * m + i] * b[j];
      b[i] /= A[i * m + i];
    }
    for (int i = 0; i < n; ++i) x[order[i]] = b[i];
    std::copy(x.begin(), x.end(), b);
  }
}

}  // namespace mbdae
