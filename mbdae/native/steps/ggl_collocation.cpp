#include "steps/ggl_collocation.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "math/eigen_types.hpp"
#include "steps/stage_solver.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

struct LinearizedGGL : LinearizedStages {
  Numbers P;  // (k, nv) the rows in use that have a g
};

// In the notation of mbdae/mechanism/formulations/implicit_stage.py, N = M^-1 P^T, and m = h times an eigenvalue:
//
//   [ E - m D - m^2 K S J   -L   -m K S J N ] [du' ]
//   [ G + m B S J            0     B S J N  ] [dlam]
//   [ m P S J                0     P S J N  ] [dmu ]
template <class T>
class GGLSolver final : public StageSolver {
 public:
  GGLSolver(const LinearizedGGL& partials, int nv, T mu)
      : nv_(nv),
        n_(static_cast<int>(partials.partials.K.size()) / nv),
        r_(static_cast<int>(partials.partials.g_t.size())),
        k_(static_cast<int>(partials.P.size()) / nv),
        mu_(mu),
        J_(Rows<T>::Identity(nv, nv)) {
    const EquationPartials& s = partials.partials;
    const RowsIn M(s.M.data(), nv, nv), K(s.K.data(), n_, nv), D(s.D.data(), n_, n_);
    const RowsIn G(s.G.data(), r_, nv), B(s.B.data(), r_, nv), P(partials.P.data(), k_, nv);
    S_ = J_;
    for (const TangentBlock& b : partials.turning) {
      const RowsIn J(b.J, b.n, b.n), turn(b.turn, b.n, b.n);
      const Rows<T> block = J.cast<T>(), middle = Rows<T>::Identity(b.n, b.n) - mu * turn.cast<T>();
      J_.block(b.at, b.at, b.n, b.n) = block;
      S_.block(b.at, b.at, b.n, b.n) = (middle * block).inverse();
    }
    KS_ = mu * (K.cast<T>() * S_), BS_ = B.cast<T>() * S_, PS_ = P.cast<T>() * S_;
    const Rows<double> N = M.llt().solve(P.transpose());
    JN_ = J_ * N.cast<T>();
    Rows<T> A = Rows<T>::Zero(n_ + r_ + k_, n_ + r_ + k_);
    A.topLeftCorner(n_, n_) = -mu * D.cast<T>();
    A.topLeftCorner(n_, nv) -= mu * (KS_ * J_);
    A.topLeftCorner(nv, nv) += M.cast<T>();
    for (int i = nv; i < n_; ++i) A(i, i) += T(1);
    A.block(0, n_, nv, r_) = -G.transpose().cast<T>();
    for (int i = 0; i < r_; ++i) A(n_ - 1, n_ + i) = T(s.g_t[i]);
    if (!s.friction.empty()) {
      const RowsIn by_lam(s.friction.data(), r_, nv + 1);
      A.block(0, n_, nv, r_) -= by_lam.leftCols(nv).transpose().cast<T>();
      A.block(n_ - 1, n_, 1, r_) -= by_lam.rightCols(1).transpose().cast<T>();
    }
    A.block(0, n_ + r_, n_, k_) = -KS_ * JN_;
    A.block(n_, 0, r_, nv) = G.cast<T>() + mu * (BS_ * J_);
    A.block(n_, n_ + r_, r_, k_) = BS_ * JN_;
    A.block(n_ + r_, 0, k_, nv) = mu * (PS_ * J_);
    A.block(n_ + r_, n_ + r_, k_, k_) = PS_ * JN_;
    lu_.compute(A);
    for (int i = 0; i < A.rows(); ++i) {
      const double pivot = std::abs(lu_.matrixLU()(i, i));
      if (!(pivot > 0) || !std::isfinite(pivot)) throw FallBackToPython();
    }
  }

  void solve(double* r, double* c, Numbers&) const override {
    const int ny = nv_ + n_, nz = r_ + k_;
    const Vector<T> rhs = numbers(r, ny), constraint = numbers(c, nz), x = rhs.head(nv_);
    Vector<T> b(n_ + nz), out(ny);
    b.head(n_) = rhs.tail(n_) + KS_ * x;
    b.segment(n_, r_) = constraint.head(r_) / mu_ - BS_ * x;
    b.tail(k_) = constraint.tail(k_) / mu_ - PS_ * x;
    const Vector<T> u = lu_.solve(b);
    out.head(nv_) = J_ * (S_ * (x + mu_ * (J_ * u.head(nv_)) + JN_ * u.tail(k_)));
    out.tail(n_) = u.head(n_);
    write(out, r), write(u.tail(nz), c);
  }

 private:
  static Vector<T> numbers(const double* x, int n) {
    Vector<T> out(n);
    for (int i = 0; i < n; ++i) {
      if constexpr (std::is_same_v<T, double>)
        out[i] = x[i];
      else
        out[i] = T(x[i], x[n + i]);
    }
    return out;
  }

  static void write(const Vector<T>& from, double* x) {
    const auto n = from.size();
    for (Eigen::Index i = 0; i < n; ++i) {
      x[i] = std::real(from[i]);
      if constexpr (!std::is_same_v<T, double>) x[n + i] = std::imag(from[i]);
    }
  }

  int nv_, n_, r_, k_;
  T mu_;
  Rows<T> J_, S_, KS_, BS_, PS_, JN_;
  Eigen::PartialPivLU<Rows<T>> lu_;
};

}  // namespace

GGLCollocation::GGLCollocation(Index2System& s)
    : CollocationStep(s), positions_(s), gap_(s.ng), mu_(s.ng), slip_(s.nv) {}

std::vector<int> GGLCollocation::unknowns() const {
  std::vector<int> out = CollocationStep::unknowns();
  out.insert(out.end(), positions_.kept().begin(), positions_.kept().end());
  return out;
}

std::shared_ptr<const LinearizedStages> GGLCollocation::linearize(double t, const double* x, const double* dx,
                                                                  const double* z) {
  auto out = std::make_shared<LinearizedGGL>();
  static_cast<LinearizedStages&>(*out) = *CollocationStep::linearize(t, x, dx, z);
  s_.mechanics.poses(q_.data());
  s_.constraints.value(s_.mechanics, q_.data(), positions_.kept(), G_.data());
  for (int k : positions_.kept()) {
    const double* row = &G_[static_cast<size_t>(k) * nv_];
    out->P.insert(out->P.end(), row, row + nv_);
  }
  return out;
}

void GGLCollocation::residual(double t, const double* x, const double* dx, const double* z, double* R, double* C) {
  CollocationStep::residual(t, x, dx, z, R, C);
  const std::vector<int>& rows = positions_.kept();
  const size_t r = s_.rows.in_use().size();
  s_.counts.M += 1, s_.counts.factorizations += 1, s_.counts.G += s_.ng > 0;
  s_.point.inertia(q_.data());
  std::fill(gap_.begin(), gap_.end(), 0.0), std::fill(slip_.begin(), slip_.end(), 0.0);
  s_.constraints.value(s_.mechanics, q_.data(), rows, G_.data(), gap_.data());
  s_.constraints.gaps(t, gap_.data());
  for (size_t i = 0; i < rows.size(); ++i) {
    C[r + i] = -gap_[rows[i]];
    for (int c : s_.constraints.rows[rows[i]].columns)
      slip_[c] += z[r + i] * G_[static_cast<size_t>(rows[i]) * nv_ + c];
  }
  s_.point.half(slip_.data()), s_.point.back(slip_.data());
  s_.manifold.tangent(x, slip_.data());
  for (int i = 0; i < nv_; ++i) R[i] += slip_[i];
}

std::shared_ptr<const StageSolver> GGLCollocation::stage_solver(
    const std::shared_ptr<const LinearizedStages>& partials, Complex mu) const {
  const auto& at = static_cast<const LinearizedGGL&>(*partials);
  if (mu.imag() == 0) return std::make_shared<GGLSolver<double>>(at, nv_, mu.real());
  return std::make_shared<GGLSolver<Complex>>(at, nv_, mu);
}

void GGLCollocation::all_multipliers(double t, const double* z, double* out) {
  CollocationStep::all_multipliers(t, z, out);
  const std::vector<int>& rows = positions_.kept();
  gap_ = s_.point.g;
  s_.constraints.gaps(t, gap_.data());
  const Tolerances& limits = s_.mechanics.limits;
  if (largest_scaled(gap_.data(), limits.row_scales) > limits.gaping) throw FallBackToPython();
  std::fill(mu_.begin(), mu_.end(), 0.0);
  for (size_t i = 0; i < rows.size(); ++i) mu_[rows[i]] = z[s_.rows.in_use().size() + i];
  if (!positions_.shared && positions_.rows().dependent()) positions_.saddle().symmetric();
  positions_.saddle().all_multipliers(mu_.data(), out + s_.ng);
}

}  // namespace mbdae
