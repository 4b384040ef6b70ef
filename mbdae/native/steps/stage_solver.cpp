// LU factorization of the stage system of one eigenvalue.
#include "steps/stage_solver.hpp"

#include <algorithm>

#include "math/dense_lu.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

// With N = M^-1 P^T, m = h times an eigenvalue, and L the columns of lam; P is empty except for GGL:
//
//   [ E - m D - m^2 K S J   -L   -m K S J N ] [du' ]
//   [ G + m B S J            0     B S J N  ] [dlam]
//   [ m P S J                0     P S J N  ] [dmu ]
//
// The work w' appears in no other equation; it is computed last, from the row `w_`.
template <int components>
class ModeSolver final : public StageSolver {
 public:
  ModeSolver(std::shared_ptr<const LinearizedStages> partials, int nv, Complex mu)
      : linearization_(std::move(partials)), nv_(nv), mu_(mu) {
    const EquationPartials& s = linearization_->partials;
    r_ = static_cast<int>(s.g_t.size()), n_ = static_cast<int>(s.K.size()) / nv;
    k_ = static_cast<int>(linearization_->P.size()) / nv, m_ = n_ - 1 + r_ + k_;
    lu_.resize(m_), w_.assign(static_cast<size_t>(m_) * components, 0.0);
    for (const TangentBlock& b : linearization_->tangents) blocks_.emplace_back(b, mu);
    for (int i = 0; i < n_; ++i) {
      for (int j = 0; j < n_ - 1; ++j) add(i, j, -mu * s.D[i * n_ + j]);
      add_KSJ(i, &s.K[static_cast<size_t>(i) * nv], -mu * mu);
    }
    for (int i = 0; i < nv; ++i)
      for (int j = 0; j < nv; ++j) lu_.column(j)[i] += s.M[i * nv + j];
    for (int i = nv; i < n_ - 1; ++i) lu_.column(i)[i] += 1;
    for (int k = 0; k < r_; ++k) {
      const double* G = &s.G[static_cast<size_t>(k) * nv];
      for (int j = 0; j < nv; ++j) lu_.column(n_ - 1 + k)[j] = -G[j], lu_.column(j)[n_ - 1 + k] = G[j];
      w_[n_ - 1 + k] = s.g_t[k];
      add_KSJ(n_ + k, &s.B[static_cast<size_t>(k) * nv], mu);
      if (s.friction.empty()) continue;
      const double* friction_partials = &s.friction[static_cast<size_t>(k) * (nv + 1)];
      for (int j = 0; j < nv; ++j) lu_.column(n_ - 1 + k)[j] -= friction_partials[j];
      w_[n_ - 1 + k] -= friction_partials[nv];
    }
    for (int k = 0; k < k_; ++k) add_position_row(k);
    if (!lu_.factorize()) throw FallBackToPython();
  }

  void solve(double* r, double* c, Vector& work) const override {
    const EquationPartials& s = linearization_->partials;
    const int ny = nv_ + n_, nz = r_ + k_;
    work.resize(static_cast<size_t>(components) * (nv_ + m_));
    double *x = work.data(), *b = x + components * nv_;
    for (int p = 0; p < components; ++p) std::copy(r + p * ny, r + p * ny + nv_, x + p * nv_);
    for (const TangentFactors& block : blocks_) block.apply_S(x, nv_);
    Complex w = 0;
    for (int i = 0; i < n_; ++i) {
      const Complex sum = entry(r, nv_ + i, ny) + times(mu_, times(&s.K[static_cast<size_t>(i) * nv_], x));
      i < n_ - 1 ? write(b, i, m_, sum) : void(w = sum);
    }
    for (int k = 0; k < nz; ++k) write(b, n_ - 1 + k, m_, entry(c, k, nz) / mu_ - times(constraint_partials(k), x));
    lu_.solve(b);
    for (int i = 0; i < m_; ++i) w -= times(entry(w_.data(), i, m_), entry(b, i, m_));
    for (int p = 0; p < components; ++p) std::copy(b + p * m_, b + p * m_ + nv_, x + p * nv_);
    for (const TangentFactors& block : blocks_) block.apply_J(x, nv_);
    for (int i = 0; i < nv_; ++i) {
      Complex sum = entry(r, i, ny) + times(mu_, entry(x, i, nv_));
      for (int k = 0; k < k_; ++k) sum += JN_[static_cast<size_t>(k) * nv_ + i] * entry(b, n_ - 1 + r_ + k, m_);
      write(x, i, nv_, sum);
    }
    for (const TangentFactors& block : blocks_) block.apply_S(x, nv_), block.apply_J(x, nv_);
    for (int p = 0; p < components; ++p) {
      std::copy(x + p * nv_, x + (p + 1) * nv_, r + p * ny);
      std::copy(b + p * m_, b + p * m_ + n_ - 1, r + p * ny + nv_);
      std::copy(b + p * m_ + n_ - 1, b + (p + 1) * m_, c + p * nz);
    }
    write(r, ny - 1, ny, w);
  }

 private:
  static Complex times(Complex a, Complex b) {  // without the check of operator* for non-finite values
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
  }
  static Complex entry(const double* x, int i, int n) {
    return components == 1 ? Complex(x[i]) : Complex(x[i], x[n + i]);
  }
  static void write(double* x, int i, int n, Complex value) {
    x[i] = value.real();
    if constexpr (components == 2) x[n + i] = value.imag();
  }

  struct TangentFactors {  // J of a block, with S = ((1 - mu d(J v)/dx) J)^-1
    const TangentBlock& b;
    DenseLU<components> S;
    Complex SJ[36];

    TangentFactors(const TangentBlock& block, Complex mu) : b(block) {
      const int n = b.n;
      S.resize(n);
      double column[2 * 6];
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
          double sum = 0;
          for (int k = 0; k < n; ++k) sum += b.dJv[i * n + k] * b.J[k * n + j];
          write(S.column(j), i, n, b.J[i * n + j] - mu * sum);
        }
      if (!S.factorize()) throw FallBackToPython();
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) write(column, i, n, b.J[i * n + j]);
        S.solve(column);
        for (int i = 0; i < n; ++i) SJ[i * n + j] = entry(column, i, n);
      }
    }

    void apply_S(double* x, int nv) const {  // x := S x
      double block_x[2 * 6];
      for (int i = 0; i < b.n; ++i) write(block_x, i, b.n, entry(x, b.start + i, nv));
      S.solve(block_x);
      for (int i = 0; i < b.n; ++i) write(x, b.start + i, nv, entry(block_x, i, b.n));
    }

    void apply_J(double* x, int nv) const {  // x := J x
      for (int p = 0; p < components; ++p, x += nv) {
        double block_x[6];
        std::copy(x + b.start, x + b.start + b.n, block_x);
        for (int i = 0; i < b.n; ++i) x[b.start + i] = dot(b.J + i * b.n, block_x, b.n);
      }
    }
  };

  void add(int i, int j, Complex value) {  // to row i; row n - 1 is that of w'
    double* entry_address = i == n_ - 1 ? &w_[j] : lu_.column(j) + (i < n_ ? i : i - 1);
    entry_address[0] += value.real();
    if constexpr (components == 2) entry_address[m_] += value.imag();
  }

  void add_KSJ(int i, const double* K, Complex factor) {  // factor K S J
    int j = 0;
    for (const TangentFactors& block : blocks_) {
      const TangentBlock& b = block.b;
      for (; j < b.start; ++j) add(i, j, factor * K[j]);
      for (; j < b.start + b.n; ++j) {
        Complex sum = 0;
        for (int k = 0; k < b.n; ++k) sum += K[b.start + k] * block.SJ[k * b.n + j - b.start];
        add(i, j, times(factor, sum));
      }
    }
    for (; j < nv_; ++j) add(i, j, factor * K[j]);
  }

  void add_position_row(int k) {  // and the column of its multiplier mu
    const size_t start = static_cast<size_t>(k) * nv_;
    const int column = n_ - 1 + r_ + k;
    Vector y(static_cast<size_t>(components) * nv_, 0.0);
    std::copy_n(&linearization_->N[start], nv_, y.begin());
    for (const TangentFactors& block : blocks_) block.apply_J(y.data(), nv_);
    JN_.insert(JN_.end(), y.begin(), y.begin() + nv_);
    for (const TangentFactors& block : blocks_) block.apply_S(y.data(), nv_);
    add_KSJ(n_ + r_ + k, &linearization_->P[start], mu_);
    for (int i = 0; i < n_; ++i)
      add(i, column, -times(mu_, times(&linearization_->partials.K[static_cast<size_t>(i) * nv_], y.data())));
    for (int i = 0; i < r_ + k_; ++i) add(n_ + i, column, times(constraint_partials(i), y.data()));
  }

  const double* constraint_partials(int k) const {  // d(G v)/dq of a row, or a row of P
    const Vector& rows = k < r_ ? linearization_->partials.B : linearization_->P;
    return &rows[static_cast<size_t>(k < r_ ? k : k - r_) * nv_];
  }

  Complex times(const double* K, const double* x) const {  // dot product of a row and a vector
    double re = 0, im = 0;
    for (int j = 0; j < nv_; ++j) {
      re += K[j] * x[j];
      if constexpr (components == 2) im += K[j] * x[nv_ + j];
    }
    return {re, im};
  }

  std::shared_ptr<const LinearizedStages> linearization_;
  int nv_, n_, r_, k_, m_;
  Complex mu_;
  std::vector<TangentFactors> blocks_;
  DenseLU<components> lu_;
  Vector w_, JN_;
};

}  // namespace

std::shared_ptr<const StageSolver> make_stage_solver(const std::shared_ptr<const LinearizedStages>& partials, int nv,
                                                     Complex mu) {
  if (mu.imag() == 0) return std::make_shared<ModeSolver<1>>(partials, nv, mu);
  return std::make_shared<ModeSolver<2>>(partials, nv, mu);
}

}  // namespace mbdae
