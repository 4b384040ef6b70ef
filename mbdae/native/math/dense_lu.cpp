// LU with partial pivoting, by panels of columns, of full and of band matrices.
#include "math/dense_lu.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

namespace mbdae {

namespace {

constexpr int PANEL = 4;      // columns of a panel, which are eliminated together
constexpr int SMALLEST = 50;  // smaller matrices are full

// Positions of the unknowns in the reverse order of Cuthill and McKee, which gives coupled unknowns near positions.
std::vector<int> reverse_cuthill_mckee(const std::vector<std::vector<int>>& neighbours) {
  const int n = static_cast<int>(neighbours.size());
  const auto fewer = [&](int i, int j) { return neighbours[i].size() < neighbours[j].size(); };
  std::vector<int> by_degree(n), level, position(n, -1);
  std::iota(by_degree.begin(), by_degree.end(), 0);
  std::stable_sort(by_degree.begin(), by_degree.end(), fewer);
  std::vector<int> seen(n, -1);
  int last = n;
  const auto traverse = [&](int start, int mark) {  // breadth first
    level.assign(1, start), seen[start] = mark;
    for (size_t k = 0; k < level.size(); ++k) {
      const size_t first = level.size();
      for (int j : neighbours[level[k]])
        if (seen[j] != mark) seen[j] = mark, level.push_back(j);
      std::stable_sort(level.begin() + first, level.end(), fewer);
    }
  };
  for (int start : by_degree) {
    if (position[start] >= 0) continue;
    traverse(start, 2 * start);
    traverse(level.back(), 2 * start + 1);  // from an unknown at the end of a chain
    for (int i : level) position[i] = --last;
  }
  return position;
}

template <int components>
struct Scalar {  // entry i of a column
  double re, im = 0;
  Scalar(const double* column, int i, int n) : re(column[i]) {
    if constexpr (components == 2) im = column[n + i];
  }
  void write(double* column, int i, int n) const {
    column[i] = re;
    if constexpr (components == 2) column[n + i] = im;
  }
  bool is_zero() const { return re == 0 && im == 0; }
  void multiply_by(const Scalar& f) {
    const double x = re * f.re - im * f.im;
    im = re * f.im + im * f.re, re = x;
  }
};

// a[from..to] -= f b[from..to]; n, m: between real and imaginary parts of a and b
template <int components>
void subtract(double* __restrict a, const double* __restrict b, const Scalar<components>& f, int from, int to, int n,
              int m) {
  if constexpr (components == 1) {
    for (int i = from; i < to; ++i) a[i] -= f.re * b[i];
  } else {
    double* __restrict im = a + n;
    for (int i = from; i < to; ++i) {
      a[i] -= f.re * b[i] - f.im * b[m + i];
      im[i] -= f.re * b[m + i] + f.im * b[i];
    }
  }
}

// The same with four columns b, `step` apart, one after the other.
template <int components>
void subtract_panel(double* __restrict a, const double* __restrict b, size_t step, const Scalar<components>* f,
                    int from, int to, int n) {
  const double *p = b, *q = p + step, *r = q + step, *s = r + step;
  const double f0 = f[0].re, f1 = f[1].re, f2 = f[2].re, f3 = f[3].re;
  if constexpr (components == 1) {
    for (int i = from; i < to; ++i) a[i] -= f0 * p[i] + f1 * q[i] + f2 * r[i] + f3 * s[i];
  } else {
    const double g0 = f[0].im, g1 = f[1].im, g2 = f[2].im, g3 = f[3].im;
    double* __restrict im = a + n;
    const double *P = p + n, *Q = q + n, *R = r + n, *S = s + n;
    for (int i = from; i < to; ++i) {
      a[i] -= f0 * p[i] - g0 * P[i] + f1 * q[i] - g1 * Q[i] + f2 * r[i] - g2 * R[i] + f3 * s[i] - g3 * S[i];
      im[i] -= f0 * P[i] + g0 * p[i] + f1 * Q[i] + g1 * q[i] + f2 * R[i] + g2 * r[i] + f3 * S[i] + g3 * s[i];
    }
  }
}

// b[k] - sum_i a[i] b[i] over from..to; n, m: as above, of b and a
template <int components>
Scalar<components> subtract_product(const double* b, const double* a, int k, int from, int to, int n, int m) {
  Scalar<components> x(b, k, n);
  for (int i = from; i < to; ++i) {
    Scalar<components> term(b, i, n);
    term.multiply_by(Scalar<components>(a, i, m));
    x.re -= term.re, x.im -= term.im;
  }
  return x;
}

template <int components>
void swap(double* b, int i, int j, int n) {
  if (i == j) return;
  std::swap(b[i], b[j]);
  if constexpr (components == 2) std::swap(b[n + i], b[n + j]);
}

}  // namespace

template <int components>
void DenseLU<components>::resize(int n) {
  n_ = n;
  a_.assign(static_cast<size_t>(n) * n * components, 0.0), swap_.assign(n, 0);
}

template <int components>
bool DenseLU<components>::find_band() {
  position_.clear(), lower_ = upper_ = stride_ = n_, step_ = static_cast<size_t>(components) * n_, shift_ = 0;
  if (n_ < SMALLEST) return true;
  std::vector<std::pair<int, int>> entries;
  const size_t most = static_cast<size_t>(n_) * n_ / 8;
  for (int j = 0; j < n_; ++j) {
    const double* a = column(j);
    for (int i = 0; i < n_; ++i) {
      const double size = components == 1 ? std::fabs(a[i]) : std::fabs(a[i]) + std::fabs(a[n_ + i]);
      if (size == 0) continue;
      if (!std::isfinite(size)) return false;
      entries.emplace_back(i, j);
    }
    if (entries.size() > most) return true;
  }
  std::vector<std::vector<int>> neighbours(n_);
  for (const auto& [i, j] : entries)
    if (i != j) neighbours[i].push_back(j), neighbours[j].push_back(i);
  std::vector<int> position = reverse_cuthill_mckee(neighbours);
  int below = 0, above = 0;
  for (const auto& [i, j] : entries)
    below = std::max(below, position[i] - position[j]), above = std::max(above, position[j] - position[i]);
  const double band = static_cast<double>(below) * (below + above), all = static_cast<double>(n_) * n_;
  if (6 * band > all) return true;  // little work saved
  position_ = std::move(position);
  lower_ = below, upper_ = below + above;
  const int before = upper_ + PANEL;  // rows of a column before the diagonal
  stride_ = before + lower_ + PANEL + 1, step_ = static_cast<size_t>(components) * stride_ - 1, shift_ = before;
  band_.assign(static_cast<size_t>(n_) * components * stride_, 0.0);
  for (const auto& [i, j] : entries)
    Scalar<components>(column(j), i, n_).write(factor(position_[j]), position_[i], stride_);
  return true;
}

template <int components>
bool DenseLU<components>::factorize() {
  return find_band() && eliminate();
}

template <int components>
bool DenseLU<components>::eliminate() {
  using S = Scalar<components>;
  const int n = stride_;
  for (int first = 0; first < n_; first += PANEL) {
    const int end = std::min(first + PANEL, n_), rows = last_row(end), columns = last_column(end);
    for (int k = first; k < end; ++k) {
      double *a = factor(k), largest = -1;
      for (int i = k; i < rows; ++i) {
        const double size = components == 1 ? std::fabs(a[i]) : std::fabs(a[i]) + std::fabs(a[n + i]);
        if (size > largest) largest = size, swap_[k] = i;
      }
      if (!(largest > 0) || !std::isfinite(largest)) return false;
      for (int j = first; j < columns; ++j) swap<components>(factor(j), k, swap_[k], n);
      S pivot(a, k, n);
      if constexpr (components == 1) {
        pivot.re = 1 / pivot.re;
      } else {
        const std::complex<double> inverse = 1.0 / std::complex<double>(pivot.re, pivot.im);
        pivot.re = inverse.real(), pivot.im = inverse.imag();
      }
      pivot.write(a, k, n);
      for (int i = k + 1; i < rows; ++i) {
        S x(a, i, n);
        x.multiply_by(pivot);
        x.write(a, i, n);
      }
      for (int j = k + 1; j < end; ++j) {
        const S f(factor(j), k, n);
        if (!f.is_zero()) subtract<components>(factor(j), a, f, k + 1, rows, n, n);
      }
    }
    for (int j = end; j < columns; ++j) {
      double* a = factor(j);
      for (int k = first; k < end; ++k) {
        const S f(a, k, n);
        for (int i = k + 1; i < end && !f.is_zero(); ++i) {
          S x(a, i, n), y(factor(k), i, n);
          y.multiply_by(f);
          x.re -= y.re, x.im -= y.im;
          x.write(a, i, n);
        }
      }
      const S f[PANEL] = {{a, first, n}, {a, first + 1, n}, {a, first + 2, n}, {a, first + 3, n}};
      if (f[0].is_zero() && f[1].is_zero() && f[2].is_zero() && f[3].is_zero()) continue;
      subtract_panel<components>(a, factor(first), step_, f, end, rows, n);
    }
  }
  return true;
}

template <int components>
template <class Solve>
void DenseLU<components>::in_order(double* b, Solve&& solve) const {
  if (position_.empty()) return solve(b);
  Vector ordered(static_cast<size_t>(components) * n_);
  for (int i = 0; i < n_; ++i) Scalar<components>(b, i, n_).write(ordered.data(), position_[i], n_);
  solve(ordered.data());
  for (int i = 0; i < n_; ++i) Scalar<components>(ordered.data(), position_[i], n_).write(b, i, n_);
}

template <int components>
void DenseLU<components>::solve(double* b) const {
  in_order(b, [&](double* x) { solve_factors(x); });
}

template <int components>
void DenseLU<components>::solve_transposed(double* b) const {
  in_order(b, [&](double* x) { solve_factors_transposed(x); });
}

template <int components>
void DenseLU<components>::solve_factors(double* b) const {
  using S = Scalar<components>;
  const int n = n_;
  for (int first = 0; first < n; first += PANEL) {
    const int end = std::min(first + PANEL, n);
    for (int k = first; k < end; ++k) swap<components>(b, k, swap_[k], n);
    for (int k = first; k < end; ++k) {
      const S f(b, k, n);
      if (!f.is_zero()) subtract<components>(b, factor(k), f, k + 1, last_row(end), n, stride_);
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    S f(b, k, n);
    f.multiply_by(S(factor(k), k, stride_));
    f.write(b, k, n);
    subtract<components>(b, factor(k), f, std::max(0, k - upper_), k, n, stride_);
  }
}

template <int components>
void DenseLU<components>::solve_factors_transposed(double* b) const {
  using S = Scalar<components>;
  const int n = n_;
  for (int k = 0; k < n; ++k) {
    S x = subtract_product<components>(b, factor(k), k, std::max(0, k - upper_), k, n, stride_);
    x.multiply_by(S(factor(k), k, stride_));
    x.write(b, k, n);
  }
  for (int first = (n - 1) / PANEL * PANEL; first >= 0; first -= PANEL) {
    const int end = std::min(first + PANEL, n);
    for (int k = end - 1; k >= first; --k)
      subtract_product<components>(b, factor(k), k, k + 1, last_row(end), n, stride_).write(b, k, n);
    for (int k = end - 1; k >= first; --k) swap<components>(b, k, swap_[k], n);
  }
}

template <int components>
bool DenseLU<components>::positive_determinant() const {
  bool out = true;
  for (int k = 0; k < n_; ++k) out ^= (swap_[k] != k) != (factor(k)[k] < 0);
  return out;
}

template class DenseLU<1>;
template class DenseLU<2>;

}  // namespace mbdae
