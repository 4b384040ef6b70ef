// Residuals, Newton matrix and predictor of generalized-alpha steps.
#include "steps/newmark.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

NewmarkStep::NewmarkStep(Index2System& s)
    : CollocationStep(s), n_(s.ny - s.nv), displacement_(s.ny), R1_(s.ny), C1_(s.ng), g_(s.ng), multipliers_(s.ng) {}

void NewmarkStep::start(const GeneralizedAlpha& a, double t, double h, const Vector& y, double* a_0,
                            double* rate) {
  Vector F(ny_), F_perturbed(ny_), y_perturbed(y.size()), x(ny_);
  s_.derivative(t, y.data(), F.data(), multipliers_.data());
  std::copy_n(&F[nv_], n_, rate), std::copy_n(&F[nv_], n_, a_0);
  const double offset = a.alpha_m - a.alpha_f, dt = std::fabs(offset) * h;
  if (offset == 0) return;
  for (int i = 0; i < ny_; ++i) x[i] = dt * F[i];
  s_.add(y.data(), x.data(), y_perturbed.data());
  s_.derivative(t + dt, y_perturbed.data(), F_perturbed.data(), multipliers_.data());
  for (int i = 0; i < n_; ++i) a_0[i] += std::copysign(1.0, offset) * (F_perturbed[nv_ + i] - F[nv_ + i]);
}

void NewmarkStep::set_displacement(Vector& out) const {
  const int r = static_cast<int>(s_.rows.in_use().size()), m = static_cast<int>(normal_.size()) / nv_;
  out = predictor_;
  for (int i = 0; i < nv_; ++i) out[i] += b2_ * x_[i];
  for (int k = 0; k < m; ++k)
    for (int i = 0; i < nv_; ++i) out[i] += x_[n_ + r + k] * normal_[static_cast<size_t>(k) * nv_ + i];
  for (int i = 0; i < n_; ++i) out[nv_ + i] += b1_ * x_[i];
}

void NewmarkStep::correct(const GeneralizedAlpha& a, double t, Vector& dx) {
  const std::vector<int>& rows = s_.rows.in_use();
  const int r = static_cast<int>(rows.size()), m = static_cast<int>(normal_.size()) / nv_;
  const size_t nv = nv_, n = n_;
  set_displacement(displacement_);
  Vector rates(ny_), lam(s_.ng, 0.0);
  std::copy_n(x_.data(), nv_, rates.data()), std::copy_n(x_.data(), n_, &rates[nv_]);
  for (int k = 0; k < r; ++k) lam[rows[k]] = x_[n_ + k];
  s_.manifold.check_rotations(displacement_.data());
  residual(t, displacement_.data(), rates.data(), &x_[n_], R1_.data(), C1_.data());
  s_.constraints.dense_value(s_.tree, q_.data(), rows, G_, g_.data());
  s_.constraints.complete_g(t, g_.data());
  for (int i = 0; i < n_; ++i) u_[i] = y0_[nq_ + i] + displacement_[nv_ + i];
  s_.partials(t, q_.data(), u_.data(), x_.data(), lam.data(), partials_);
  if (s_.manifold.curved()) {
    const Vector zero(nv_, 0.0);
    s_.manifold.transfer(zero.data(), displacement_.data(), inverse_);
  }
  for (Vector* X : {&partials_.K, &partials_.B}) multiply_rows(inverse_, *X, nv_);
  Vector GV(partials_.G);
  multiply_rows(inverse_, GV, nv_);

  const int size = n_ + r + m;
  matrix_.resize(size);
  std::vector<size_t> nonzero;  // columns: few in systems of many bodies
  const auto add_to_row = [&](int i, const double* du_partials, const double* dx_partials, double weight,
                              double factor) {
    // row i: factor * du_partials (nv,) + weight * dx_partials in the columns of v'; weight * dx_partials N in those of
    // mu
    nonzero.clear();
    for (size_t j = 0; j < nv; ++j) {
      const double entry = (du_partials ? factor * du_partials[j] : 0) + weight * dx_partials[j];
      if (entry != 0) matrix_.column(static_cast<int>(j))[i] += entry;
      if (dx_partials[j] != 0) nonzero.push_back(j);
    }
    for (int k = 0; k < m; ++k) {
      const double* normal = &normal_[static_cast<size_t>(k) * nv];
      double sum = 0;
      for (size_t j : nonzero) sum += dx_partials[j] * normal[j];
      if (sum != 0) matrix_.column(n_ + r + k)[i] += weight * sum;
    }
  };
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j)
      if (const double D = partials_.D[i * n + j]; D != 0) matrix_.column(static_cast<int>(j))[i] = -b1_ * D;
    if (i >= nv) matrix_.column(static_cast<int>(i))[i] += 1;
    add_to_row(static_cast<int>(i), i < nv ? &partials_.M[i * nv] : nullptr, &partials_.K[i * nv], -b2_, 1);
    dx[i] = R1_[nv + i];
  }
  for (int k = 0; k < r; ++k) {
    const double* G = &partials_.G[static_cast<size_t>(k) * nv];
    double* column = matrix_.column(n_ + k);
    for (size_t i = 0; i < nv; ++i) column[i] = -G[i];
    column[n - 1] = partials_.g_t[k];
    if (!partials_.friction.empty())
      for (size_t i = 0; i <= nv; ++i)
        column[i < nv ? i : n - 1] -= partials_.friction[static_cast<size_t>(k) * (nv + 1) + i];
    int row = n_ + k;
    if (a.stabilized) {
      add_to_row(row, G, &partials_.B[static_cast<size_t>(k) * nv], b2_ / b1_, 1);
      dx[row] = C1_[k] / b1_, row += r;
    }
    add_to_row(row, nullptr, &GV[static_cast<size_t>(k) * nv], 1, 0);
    dx[row] = -g_[rows[k]] / b2_;
  }
  s_.counts.factorizations += 1, s_.counts.solves += 1;
  if (!matrix_.factorize()) throw FallBackToPython();
  matrix_.solve(dx.data());
  for (int k = 0; k < m; ++k) dx[n_ + r + k] *= b2_;
}

std::pair<double, double> NewmarkStep::change_and_scale(const Vector& dx) const {
  const Tolerances& tolerances = s_.tree.tolerances;
  double speed = 0, change = 0, position = 0;
  for (int i = 0; i < nv_; ++i) {
    const double scale = tolerances.coordinate_scales[i];
    speed = std::max(speed, (std::fabs(y0_[nq_ + i]) + std::fabs(h_ * x_[i])) / scale);
    change = std::max(change, std::fabs(h_ * dx[i]) / scale);
    if (!std::isfinite(dx[i])) change = dx[i];
  }
  speed += tolerances.tiny;
  for (int i = 0; i < nq_; ++i) position = std::max(position, std::fabs(y0_[i]) / tolerances.q_scales[i]);
  return {change / speed, 1 + (1 + position) / (std::fabs(h_) * speed)};
}

void NewmarkStep::take(const GeneralizedAlpha& a, double t, double h, const State& in, State& out, double* z) {
  y0_ = in.y, h_ = h;
  const double* y = y0_.data();
  if (!s_.point.is_current(y)) s_.point.evaluate(y, true);
  s_.select_rows_of_step(y);
  Vector previous(in.carry);
  if (previous.size() != static_cast<size_t>(2 * n_ + 1)) {
    previous.assign(2 * n_ + 1, h);
    start(a, t, h, in.y, previous.data(), previous.data() + n_);
    if (!s_.point.is_current(y)) s_.point.evaluate(y, true);
  }
  const std::vector<int>& rows = s_.rows.in_use();
  const int r = static_cast<int>(rows.size()), m = a.stabilized ? r : 0;
  normal_.assign(static_cast<size_t>(m) * nv_, 0.0);
  for (int k = 0; k < m; ++k) {
    double* row = &normal_[static_cast<size_t>(k) * nv_];
    s_.constraints.expand(rows[k], s_.point.Z.data(), row), s_.point.solve_root_transposed(row);
  }

  const double weight = (1 - a.alpha_f) / (1 - a.alpha_m), ratio = h / previous[2 * n_];
  const double *a_0 = previous.data(), *rate = a_0 + n_;
  b1_ = h * a.gamma * weight, b2_ = h * h * a.beta * weight;
  predictor_.assign(ny_, 0.0), x_.assign(n_ + r + m, 0.0);
  Vector predicted_a(n_);
  for (int i = 0; i < n_; ++i) {
    const double start = rate[i] + ratio * (a_0[i] - rate[i]);
    predicted_a[i] = (a.alpha_f * rate[i] - a.alpha_m * start) / (1 - a.alpha_m);
    if (i < nv_) predictor_[i] = h * y[nq_ + i] + h * h * ((0.5 - a.beta) * start + a.beta * predicted_a[i]);
    predictor_[nv_ + i] = h * ((1 - a.gamma) * start + a.gamma * predicted_a[i]);
    x_[i] = rate[i];
  }
  solve_by_newton(
      a.iteration, s_.counts, x_, [&](Vector& dx) { correct(a, t + h, dx); },
      [&](const Vector& dx) { return change_and_scale(dx); });

  set_displacement(displacement_);
  out.memory.reset(), out.carry.resize(2 * n_ + 1);
  for (int i = 0; i < n_; ++i) out.carry[i] = predicted_a[i] + weight * x_[i], out.carry[n_ + i] = x_[i];
  out.carry[2 * n_] = h;
  s_.move(in, displacement_.data(), out);
  s_.point.evaluate(out.y.data(), true);
  std::fill(multipliers_.begin(), multipliers_.end(), 0.0);
  for (int k = 0; k < r; ++k) multipliers_[rows[k]] = x_[n_ + k];
  s_.saddle.factorize_symmetric();
  s_.saddle.all_multipliers(multipliers_.data(), z);
  s_.probe_other_rows();
  if (!finite(out.y.data(), s_.length) || !finite(z, s_.nz)) throw FallBackToPython();
}

}  // namespace mbdae
