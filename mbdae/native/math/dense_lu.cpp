// LU with partial pivoting of full matrices, by panels of columns.
#include "math/dense_lu.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

namespace mbdae {

namespace {

constexpr int PANEL = 4;  // columns of a panel, which are eliminated together

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

// a[from..to] -= f b[from..to]
template <int components>
void subtract(double* __restrict a, const double* __restrict b, const Scalar<components>& f, int from, int to, int n) {
  if constexpr (components == 1) {
    for (int i = from; i < to; ++i) a[i] -= f.re * b[i];
  } else {
    double* __restrict im = a + n;
    for (int i = from; i < to; ++i) {
      a[i] -= f.re * b[i] - f.im * b[n + i];
      im[i] -= f.re * b[n + i] + f.im * b[i];
    }
  }
}

// The same with four columns b, one after the other.
template <int components>
void subtract_panel(double* __restrict a, const double* __restrict b, const Scalar<components>* f, int from, int n) {
  const double *p = b, *q = p + components * n, *r = q + components * n, *s = r + components * n;
  const double f0 = f[0].re, f1 = f[1].re, f2 = f[2].re, f3 = f[3].re;
  if constexpr (components == 1) {
    for (int i = from; i < n; ++i) a[i] -= f0 * p[i] + f1 * q[i] + f2 * r[i] + f3 * s[i];
  } else {
    const double g0 = f[0].im, g1 = f[1].im, g2 = f[2].im, g3 = f[3].im;
    double* __restrict im = a + n;
    const double *P = p + n, *Q = q + n, *R = r + n, *S = s + n;
    for (int i = from; i < n; ++i) {
      a[i] -= f0 * p[i] - g0 * P[i] + f1 * q[i] - g1 * Q[i] + f2 * r[i] - g2 * R[i] + f3 * s[i] - g3 * S[i];
      im[i] -= f0 * P[i] + g0 * p[i] + f1 * Q[i] + g1 * q[i] + f2 * R[i] + g2 * r[i] + f3 * S[i] + g3 * s[i];
    }
  }
}

// b[k] - sum_i a[i] b[i] over from..to
template <int components>
Scalar<components> subtract_product(const double* b, const double* a, int k, int from, int to, int n) {
  Scalar<components> x(b, k, n);
  for (int i = from; i < to; ++i) {
    Scalar<components> term(b, i, n);
    term.multiply_by(Scalar<components>(a, i, n));
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
bool DenseLU<components>::factorize() {
  using S = Scalar<components>;
  const int n = n_;
  for (int first = 0; first < n; first += PANEL) {
    const int end = std::min(first + PANEL, n);
    for (int k = first; k < end; ++k) {
      double *a = column(k), largest = -1;
      for (int i = k; i < n; ++i) {
        const double size = components == 1 ? std::fabs(a[i]) : std::fabs(a[i]) + std::fabs(a[n + i]);
        if (size > largest) largest = size, swap_[k] = i;
      }
      if (!(largest > 0) || !std::isfinite(largest)) return false;
      for (int j = 0; j < n; ++j) swap<components>(column(j), k, swap_[k], n);
      S pivot(a, k, n);
      if constexpr (components == 1) {
        pivot.re = 1 / pivot.re;
      } else {
        const std::complex<double> inverse = 1.0 / std::complex<double>(pivot.re, pivot.im);
        pivot.re = inverse.real(), pivot.im = inverse.imag();
      }
      pivot.write(a, k, n);
      for (int i = k + 1; i < n; ++i) {
        S x(a, i, n);
        x.multiply_by(pivot);
        x.write(a, i, n);
      }
      for (int j = k + 1; j < end; ++j) {
        const S f(column(j), k, n);
        if (!f.is_zero()) subtract<components>(column(j), a, f, k + 1, n, n);
      }
    }
    for (int j = end; j < n; ++j) {
      double* a = column(j);
      for (int k = first; k < end; ++k) {
        const S f(a, k, n);
        for (int i = k + 1; i < end && !f.is_zero(); ++i) {
          S x(a, i, n), y(column(k), i, n);
          y.multiply_by(f);
          x.re -= y.re, x.im -= y.im;
          x.write(a, i, n);
        }
      }
      const S f[PANEL] = {{a, first, n}, {a, first + 1, n}, {a, first + 2, n}, {a, first + 3, n}};
      if (f[0].is_zero() && f[1].is_zero() && f[2].is_zero() && f[3].is_zero()) continue;
      subtract_panel<components>(a, column(first), f, end, n);
    }
  }
  return true;
}

template <int components>
void DenseLU<components>::solve(double* b) const {
  using S = Scalar<components>;
  const int n = n_;
  const double* a = a_.data();
  for (int k = 0; k < n; ++k) swap<components>(b, k, swap_[k], n);
  for (int k = 0; k < n; ++k, a += components * n) {
    const S f(b, k, n);
    if (!f.is_zero()) subtract<components>(b, a, f, k + 1, n, n);
  }
  for (int k = n - 1; k >= 0; --k) {
    a -= components * n;
    S f(b, k, n);
    f.multiply_by(S(a, k, n));
    f.write(b, k, n);
    subtract<components>(b, a, f, 0, k, n);
  }
}

template <int components>
void DenseLU<components>::solve_transposed(double* b) const {
  using S = Scalar<components>;
  const int n = n_;
  const double* a = a_.data();
  for (int k = 0; k < n; ++k, a += components * n) {
    S x = subtract_product<components>(b, a, k, 0, k, n);
    x.multiply_by(S(a, k, n));
    x.write(b, k, n);
  }
  for (int k = n - 1; k >= 0; --k) {
    a -= components * n;
    subtract_product<components>(b, a, k, k + 1, n, n).write(b, k, n);
  }
  for (int k = n - 1; k >= 0; --k) swap<components>(b, k, swap_[k], n);
}

template <int components>
bool DenseLU<components>::positive_determinant() const {
  bool out = true;
  for (int k = 0; k < n_; ++k) out ^= (swap_[k] != k) != (a_[static_cast<size_t>(k) * (components * n_ + 1)] < 0);
  return out;
}

template class DenseLU<1>;
template class DenseLU<2>;

}  // namespace mbdae
