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
      for (int j = 0; j < b.n; ++j) s += m[transposed ? b.n * j + i : b.n * i + j] * x[b.at + j];
      out[b.at + i] = s;
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

// Where rows of Z are long because bodies are light, digits cancel: one step of iterative refinement.
void StageSensitivity::satisfy_rows(const Vector& seen, bool transposed, const Vector& moved) {
  const std::vector<int>& position = s_.rows.position();
  nu.assign(target_.size(), 0.0), residual_.resize(target_.size());
  for (int pass = 0; pass < 2; ++pass) {
    for (int k : s_.rows.in_use())
      residual_[position[k]] = target_[position[k]] - s_.constraints.times(k, seen, above.data());
    if (transposed) {
      lu.solve_transposed(residual_.data());
    } else {
      lu.solve(residual_.data());
    }
    for (int k : s_.rows.in_use()) {
      s_.constraints.add(k, moved, residual_[position[k]], above.data());
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
  rate_.resize(nv), dq_.resize(nv), du_.resize(n), more_.resize(nv), above.assign(n, 0.0), nu.assign(r, 0.0);
  apply(integrate_partials, &IntegratePartialsBlock::A, false, true, nv, dy, dq_.data());
  apply(integrate_partials, &IntegratePartialsBlock::R, false, true, nv, dx, more_.data());
  for (int i = 0; i < nv; ++i) dq_[i] += more_[i];
  for (int i = 0; i < n; ++i) du_[i] = dy[nv + i] + dx[nv + i];
  apply(integrate_partials, &IntegratePartialsBlock::J, false, true, nv, du_.data(), rate_.data());
  apply(integrate_partials, &IntegratePartialsBlock::T, false, false, nv, dx, more_.data());
  for (int i = 0; i < nv; ++i) rate_[i] += more_[i];
  if (P) std::copy(P, P + n, above.begin());
  add_times(at.K, n, nv, dq_.data(), above.data()), add_times(at.D, n, n, du_.data(), above.data());
  point.solve_root(above.data());
  if (r) {
    for (int i = 0; i < nv; ++i) more_[i] = dxhat[i] + factor * rate_[i];
    apply(integrate_partials_hat, &IntegratePartialsBlock::R, false, true, nv, more_.data(), du_.data());
    apply(integrate_partials_hat, &IntegratePartialsBlock::A, false, true, nv, dy, dq_.data());
    for (int i = 0; i < nv; ++i) dq_[i] += du_[i], more_[i] = dy[nv + i] + dxhat[nv + i];
    target_.assign(r, 0.0);
    if (Q) std::copy(Q, Q + r, target_.begin());
    add_times(Bhat, r, nv, dq_.data(), target_.data());
    for (int k : rows) {
      double& constrained = target_[position[k]];
      constrained = s_.constraints.times(k, Ghat, more_.data(), constrained) / -factor;
    }
    satisfy_rows(Zhat, false, point.Z);
    above[n - 1] -= dot(at.g_t.data(), nu.data(), static_cast<int>(r));
  }
  point.solve_root_transposed(above.data());
  std::copy(rate_.begin(), rate_.end(), dF), std::copy(above.begin(), above.end(), dF + nv);
}

void StageSensitivity::reverse(const double* F, double* x, double* xhat, double* y) {
  const int nv = s_.nv, n = nv + s_.ns + 1;
  const std::vector<int>& rows = s_.rows.in_use();
  const std::vector<int>& position = s_.rows.position();
  const size_t r = rows.size();
  rate_.assign(F, F + nv), dq_.assign(nv, 0.0), du_.assign(n, 0.0), more_.resize(nv);
  above.assign(F + nv, F + nv + n), nu.assign(r, 0.0);
  point.solve_root(above.data());
  if (r) {
    target_.resize(r);
    for (size_t k = 0; k < r; ++k) target_[k] = at.g_t[k] * above[n - 1];
    satisfy_rows(point.Z, true, Zhat);
    for (double& w : nu) w /= factor;
    add_transposed(Bhat, r, nv, nu.data(), dq_.data());
    apply(integrate_partials_hat, &IntegratePartialsBlock::R, true, true, nv, dq_.data(), more_.data());
    for (int i = 0; i < nv; ++i) xhat[i] += more_[i], rate_[i] += factor * more_[i];
    apply(integrate_partials_hat, &IntegratePartialsBlock::A, true, true, nv, dq_.data(), more_.data());
    for (int i = 0; i < nv; ++i) y[i] += more_[i];
    for (int k : rows) {
      s_.constraints.add(k, Ghat, nu[position[k]], xhat + nv), s_.constraints.add(k, Ghat, nu[position[k]], y + nv);
    }
    std::fill(dq_.begin(), dq_.end(), 0.0);
  }
  point.solve_root_transposed(above.data());
  add_transposed(at.K, n, nv, above.data(), dq_.data()), add_transposed(at.D, n, n, above.data(), du_.data());
  apply(integrate_partials, &IntegratePartialsBlock::J, true, true, nv, rate_.data(), more_.data());
  for (int i = 0; i < nv; ++i) du_[i] += more_[i];
  apply(integrate_partials, &IntegratePartialsBlock::T, true, false, nv, rate_.data(), more_.data());
  for (int i = 0; i < nv; ++i) x[i] += more_[i];
  apply(integrate_partials, &IntegratePartialsBlock::R, true, true, nv, dq_.data(), more_.data());
  for (int i = 0; i < nv; ++i) x[i] += more_[i];
  apply(integrate_partials, &IntegratePartialsBlock::A, true, true, nv, dq_.data(), more_.data());
  for (int i = 0; i < nv; ++i) y[i] += more_[i];
  for (int i = 0; i < n; ++i) x[nv + i] += du_[i], y[nv + i] += du_[i];
}

}  // namespace mbdae
