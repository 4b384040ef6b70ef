#include "steps/newmark.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

NewmarkStep::NewmarkStep(Index2System& s)
    : CollocationStep(s), n_(s.ny - s.nv), full_(s.ny), R1_(s.ny), C1_(s.ng), g_(s.ng), multipliers_(s.ng) {}

void NewmarkStep::start(const GeneralizedAlpha& a, double t, double h, const Vector& y, double* a_0,
                            double* rate) {
  Vector F(ny_), ahead(ny_), moved(y.size()), x(ny_);
  s_.derivative(t, y.data(), F.data(), multipliers_.data());
  std::copy_n(&F[nv_], n_, rate), std::copy_n(&F[nv_], n_, a_0);
  const double offset = a.alpha_m - a.alpha_f, later = std::fabs(offset) * h;
  if (offset == 0) return;
  for (int i = 0; i < ny_; ++i) x[i] = later * F[i];
  s_.add(y.data(), x.data(), moved.data());
  s_.derivative(t + later, moved.data(), ahead.data(), multipliers_.data());
  for (int i = 0; i < n_; ++i) a_0[i] += std::copysign(1.0, offset) * (ahead[nv_ + i] - F[nv_ + i]);
}

void NewmarkStep::displacement(Vector& out) const {
  const int r = static_cast<int>(s_.rows.in_use().size()), m = static_cast<int>(normal_.size()) / nv_;
  out = known_;
  for (int i = 0; i < nv_; ++i) out[i] += b2_ * x_[i];
  for (int k = 0; k < m; ++k)
    for (int i = 0; i < nv_; ++i) out[i] += x_[n_ + r + k] * normal_[static_cast<size_t>(k) * nv_ + i];
  for (int i = 0; i < n_; ++i) out[nv_ + i] += b1_ * x_[i];
}

void NewmarkStep::correct(const GeneralizedAlpha& a, double t, Vector& dx) {
  const std::vector<int>& rows = s_.rows.in_use();
  const int r = static_cast<int>(rows.size()), m = static_cast<int>(normal_.size()) / nv_;
  const size_t nv = nv_, n = n_;
  displacement(full_);
  Vector rates(ny_), lam(s_.ng, 0.0);
  std::copy_n(x_.data(), nv_, rates.data()), std::copy_n(x_.data(), n_, &rates[nv_]);
  for (int k = 0; k < r; ++k) lam[rows[k]] = x_[n_ + k];
  s_.manifold.check_rotations(full_.data());
  residual(t, full_.data(), rates.data(), &x_[n_], R1_.data(), C1_.data());
  s_.constraints.dense_value(s_.tree, q_.data(), rows, G_, g_.data());
  s_.constraints.complete_g(t, g_.data());
  for (int i = 0; i < n_; ++i) u_[i] = y0_[nq_ + i] + full_[nv_ + i];
  s_.partials(t, q_.data(), u_.data(), x_.data(), lam.data(), at_);
  if (s_.manifold.curved()) {
    const Vector zero(nv_, 0.0);
    s_.manifold.transfer(zero.data(), full_.data(), inverse_);
  }
  for (Vector* X : {&at_.K, &at_.B}) multiply_rows(inverse_, *X, nv_);
  Vector GV(at_.G);
  multiply_rows(inverse_, GV, nv_);

  const int size = n_ + r + m;
  matrix_.resize(size);
  const auto put = [&](int i, const double* by_u, const double* by_x, double weight, double first) {
    // row i: `first` times by_u (nv,) and weight times by_x in the columns of v'; by_x in those of mu
    for (size_t j = 0; j < nv; ++j)
      matrix_.column(static_cast<int>(j))[i] += (by_u ? first * by_u[j] : 0) + weight * by_x[j];
    for (int k = 0; k < m; ++k)
      matrix_.column(n_ + r + k)[i] += weight * dot(by_x, &normal_[static_cast<size_t>(k) * nv], nv_);
  };
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j) matrix_.column(static_cast<int>(j))[i] = -b1_ * at_.D[i * n + j];
    if (i >= nv) matrix_.column(static_cast<int>(i))[i] += 1;
    put(static_cast<int>(i), i < nv ? &at_.M[i * nv] : nullptr, &at_.K[i * nv], -b2_, 1);
    dx[i] = R1_[nv + i];
  }
  for (int k = 0; k < r; ++k) {
    const double* G = &at_.G[static_cast<size_t>(k) * nv];
    double* column = matrix_.column(n_ + k);
    for (size_t i = 0; i < nv; ++i) column[i] = -G[i];
    column[n - 1] = at_.g_t[k];
    if (!at_.friction.empty())
      for (size_t i = 0; i <= nv; ++i) column[i < nv ? i : n - 1] -= at_.friction[static_cast<size_t>(k) * (nv + 1) + i];
    int row = n_ + k;
    if (a.stabilized) {
      put(row, G, &at_.B[static_cast<size_t>(k) * nv], b2_ / b1_, 1);
      dx[row] = C1_[k] / b1_, row += r;
    }
    put(row, nullptr, &GV[static_cast<size_t>(k) * nv], 1, 0);
    dx[row] = -g_[rows[k]] / b2_;
  }
  s_.counts.factorizations += 1, s_.counts.solves += 1;
  if (!matrix_.factorize()) throw FallBackToPython();
  matrix_.solve(dx.data());
  for (int k = 0; k < m; ++k) dx[n_ + r + k] *= b2_;
}

std::pair<double, double> NewmarkStep::measure(const Vector& dx) const {
  const Tolerances& limits = s_.tree.limits;
  double speed = 0, change = 0, position = 0;
  for (int i = 0; i < nv_; ++i) {
    const double scale = limits.coordinate_scales[i];
    speed = std::max(speed, (std::fabs(y0_[nq_ + i]) + std::fabs(h_ * x_[i])) / scale);
    change = std::max(change, std::fabs(h_ * dx[i]) / scale);
    if (!std::isfinite(dx[i])) change = dx[i];
  }
  speed += limits.tiny;
  for (int i = 0; i < nq_; ++i) position = std::max(position, std::fabs(y0_[i]) / limits.q_scales[i]);
  return {change / speed, 1 + (1 + position) / (std::fabs(h_) * speed)};
}

void NewmarkStep::take(const GeneralizedAlpha& a, double t, double h, const State& in, State& out, double* z) {
  y0_ = in.y, h_ = h;
  const double* y = y0_.data();
  if (!s_.point.is_current(y)) s_.point.evaluate(y, true);
  s_.select_rows_of_step(y);
  Vector before(in.carry);
  if (before.size() != static_cast<size_t>(2 * n_ + 1)) {
    before.assign(2 * n_ + 1, h);
    start(a, t, h, in.y, before.data(), before.data() + n_);
    if (!s_.point.is_current(y)) s_.point.evaluate(y, true);
  }
  const std::vector<int>& rows = s_.rows.in_use();
  const int r = static_cast<int>(rows.size()), m = a.stabilized ? r : 0;
  normal_.assign(static_cast<size_t>(m) * nv_, 0.0);
  for (int k = 0; k < m; ++k) {
    double* row = &normal_[static_cast<size_t>(k) * nv_];
    s_.constraints.expand(rows[k], s_.point.Z.data(), row), s_.point.solve_root_transposed(row);
  }

  const double weight = (1 - a.alpha_f) / (1 - a.alpha_m), ratio = h / before[2 * n_];
  const double *a_0 = before.data(), *rate = a_0 + n_;
  b1_ = h * a.gamma * weight, b2_ = h * h * a.beta * weight;
  known_.assign(ny_, 0.0), x_.assign(n_ + r + m, 0.0);
  Vector known(n_);
  for (int i = 0; i < n_; ++i) {
    const double start = rate[i] + ratio * (a_0[i] - rate[i]);
    known[i] = (a.alpha_f * rate[i] - a.alpha_m * start) / (1 - a.alpha_m);
    if (i < nv_) known_[i] = h * y[nq_ + i] + h * h * ((0.5 - a.beta) * start + a.beta * known[i]);
    known_[nv_ + i] = h * ((1 - a.gamma) * start + a.gamma * known[i]);
    x_[i] = rate[i];
  }
  solve_by_newton(
      a.iteration, s_.counts, x_, [&](Vector& dx) { correct(a, t + h, dx); },
      [&](const Vector& dx) { return measure(dx); });

  displacement(full_);
  out.memory.reset(), out.carry.resize(2 * n_ + 1);
  for (int i = 0; i < n_; ++i) out.carry[i] = known[i] + weight * x_[i], out.carry[n_ + i] = x_[i];
  out.carry[2 * n_] = h;
  s_.move(in, full_.data(), out);
  s_.point.evaluate(out.y.data(), true);
  std::fill(multipliers_.begin(), multipliers_.end(), 0.0);
  for (int k = 0; k < r; ++k) multipliers_[rows[k]] = x_[n_ + k];
  s_.saddle.factorize_symmetric();
  s_.saddle.all_multipliers(multipliers_.data(), z);
  s_.probe_other_rows();
  if (!finite(out.y.data(), s_.length) || !finite(z, s_.nz)) throw FallBackToPython();
}

}  // namespace mbdae
