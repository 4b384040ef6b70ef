// Tangent and adjoint solutions of the saddle-point system of a stage.
#include "sensitivity/stage_sensitivity.hpp"

#include <algorithm>

#include "math/vec3.hpp"

namespace mbdae {

void apply(const std::vector<IntegratePartialsBlock>& blocks, double (IntegratePartialsBlock::*M)[36], bool transposed, bool unit, int nv,
           const double* x, double* out) {
  for (int i = 0; i < nv; ++i) out[i] = unit ? x[i] : 0;
  for (const IntegratePartialsBlock& b : blocks) {
    const double* m = b.*M;
    for (int i = 0; i < b.n; ++i) {
      double s = 0;
      for (int j = 0; j < b.n; ++j) s += m[transposed ? b.n * j + i : b.n * i + j] * x[b.start + j];
      out[b.start + i] = s;
    }
  }
}

void add_times(const Vector& A, size_t rows, size_t columns, const double* x, double* out) {
  for (size_t i = 0; i < rows; ++i) {
    const double* a = A.data() + i * columns;
    double s = 0;
    for (size_t j = 0; j < columns; ++j) s += a[j] * x[j];
    out[i] += s;
  }
}

void add_transposed(const Vector& A, size_t rows, size_t columns, const double* x, double* out) {
  for (size_t i = 0; i < rows; ++i) {
    const double* a = A.data() + i * columns;
    const double w = x[i];
    if (w != 0)
      for (size_t j = 0; j < columns; ++j) out[j] += w * a[j];
  }
}

// Long rows of Z, due to light bodies, cause cancellation: one step of iterative refinement.
void StageSensitivity::satisfy_rows(const Vector& constraint_rows, bool transposed, const Vector& force_rows) {
  const std::vector<int>& position = s_.rows.position();
  nu.assign(target_.size(), 0.0), residual_.resize(target_.size());
  for (int pass = 0; pass < 2; ++pass) {
    for (int k : s_.rows.in_use())
      residual_[position[k]] = target_[position[k]] - s_.constraints.times(k, constraint_rows, upper.data());
    if (transposed) {
      lu.solve_transposed(residual_.data());
    } else {
      lu.solve(residual_.data());
    }
    for (int k : s_.rows.in_use()) {
      s_.constraints.add(k, force_rows, residual_[position[k]], upper.data());
      nu[position[k]] += residual_[position[k]];
    }
  }
}

void StageSensitivity::forward(const double* dx, const double* dxhat, const double* dy, const double* P, const double* Q,
                          double* dF) {
  const int nv = s_.nv, n = nv + s_.ns + 1;
  const std::vector<int>& rows = s_.rows.in_use();
  const std::vector<int>& position = s_.rows.position();
  const size_t r = rows.size();
  rate_.resize(nv), dq_.resize(nv), du_.resize(n), scratch_.resize(nv), upper.assign(n, 0.0), nu.assign(r, 0.0);
  apply(integrate_partials, &IntegratePartialsBlock::A, false, true, nv, dy, dq_.data());
  apply(integrate_partials, &IntegratePartialsBlock::R, false, true, nv, dx, scratch_.data());
  for (int i = 0; i < nv; ++i) dq_[i] += scratch_[i];
  for (int i = 0; i < n; ++i) du_[i] = dy[nv + i] + dx[nv + i];
  apply(integrate_partials, &IntegratePartialsBlock::J, false, true, nv, du_.data(), rate_.data());
  apply(integrate_partials, &IntegratePartialsBlock::T, false, false, nv, dx, scratch_.data());
  for (int i = 0; i < nv; ++i) rate_[i] += scratch_[i];
  if (P) std::copy(P, P + n, upper.begin());
  add_times(partials.K, n, nv, dq_.data(), upper.data()), add_times(partials.D, n, n, du_.data(), upper.data());
  point.solve_root(upper.data());
  if (r) {
    for (int i = 0; i < nv; ++i) scratch_[i] = dxhat[i] + factor * rate_[i];
    apply(integrate_partials_hat, &IntegratePartialsBlock::R, false, true, nv, scratch_.data(), du_.data());
    apply(integrate_partials_hat, &IntegratePartialsBlock::A, false, true, nv, dy, dq_.data());
    for (int i = 0; i < nv; ++i) dq_[i] += du_[i], scratch_[i] = dy[nv + i] + dxhat[nv + i];
    target_.assign(r, 0.0);
    if (Q) std::copy(Q, Q + r, target_.begin());
    add_times(Bhat, r, nv, dq_.data(), target_.data());
    for (int k : rows) {
      double& constrained = target_[position[k]];
      constrained = s_.constraints.times(k, Ghat, scratch_.data(), constrained) / -factor;
    }
    satisfy_rows(Zhat, false, point.Z);
    upper[n - 1] -= dot(partials.g_t.data(), nu.data(), static_cast<int>(r));
  }
  point.solve_root_transposed(upper.data());
  std::copy(rate_.begin(), rate_.end(), dF), std::copy(upper.begin(), upper.end(), dF + nv);
}

void StageSensitivity::reverse(const double* F, double* x, double* xhat, double* y) {
  const int nv = s_.nv, n = nv + s_.ns + 1;
  const std::vector<int>& rows = s_.rows.in_use();
  const std::vector<int>& position = s_.rows.position();
  const size_t r = rows.size();
  rate_.assign(F, F + nv), dq_.assign(nv, 0.0), du_.assign(n, 0.0), scratch_.resize(nv);
  upper.assign(F + nv, F + nv + n), nu.assign(r, 0.0);
  point.solve_root(upper.data());
  if (r) {
    target_.resize(r);
    for (size_t k = 0; k < r; ++k) target_[k] = partials.g_t[k] * upper[n - 1];
    satisfy_rows(point.Z, true, Zhat);
    for (double& w : nu) w /= factor;
    add_transposed(Bhat, r, nv, nu.data(), dq_.data());
    apply(integrate_partials_hat, &IntegratePartialsBlock::R, true, true, nv, dq_.data(), scratch_.data());
    for (int i = 0; i < nv; ++i) xhat[i] += scratch_[i], rate_[i] += factor * scratch_[i];
    apply(integrate_partials_hat, &IntegratePartialsBlock::A, true, true, nv, dq_.data(), scratch_.data());
    for (int i = 0; i < nv; ++i) y[i] += scratch_[i];
    for (int k : rows) {
      s_.constraints.add(k, Ghat, nu[position[k]], xhat + nv), s_.constraints.add(k, Ghat, nu[position[k]], y + nv);
    }
    std::fill(dq_.begin(), dq_.end(), 0.0);
  }
  point.solve_root_transposed(upper.data());
  add_transposed(partials.K, n, nv, upper.data(), dq_.data()),
      add_transposed(partials.D, n, n, upper.data(), du_.data());
  apply(integrate_partials, &IntegratePartialsBlock::J, true, true, nv, rate_.data(), scratch_.data());
  for (int i = 0; i < nv; ++i) du_[i] += scratch_[i];
  apply(integrate_partials, &IntegratePartialsBlock::T, true, false, nv, rate_.data(), scratch_.data());
  for (int i = 0; i < nv; ++i) x[i] += scratch_[i];
  apply(integrate_partials, &IntegratePartialsBlock::R, true, true, nv, dq_.data(), scratch_.data());
  for (int i = 0; i < nv; ++i) x[i] += scratch_[i];
  apply(integrate_partials, &IntegratePartialsBlock::A, true, true, nv, dq_.data(), scratch_.data());
  for (int i = 0; i < nv; ++i) y[i] += scratch_[i];
  for (int i = 0; i < n; ++i) x[nv + i] += du_[i], y[nv + i] += du_[i];
}

}  // namespace mbdae
