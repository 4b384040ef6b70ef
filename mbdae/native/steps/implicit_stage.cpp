// Residual and linearization of a stage of an implicit method
// (mbdae/mechanism/formulations/steps/implicit_stage.py).
#include <algorithm>

#include "steps/collocation.hpp"
#include "steps/stage_solver.hpp"

namespace mbdae {

void CollocationStep::residual(double t, const double* x, const double* dx, const double* z, double* R, double* C) {
  const std::vector<int>& rows = s_.rows.in_use();
  Constraints& constraints = s_.constraints;
  s_.manifold.integrate(y0_.data(), x, q_.data());
  for (int i = 0; i < nv_ + ns_; ++i) u_[i] = y0_[nq_ + i] + x[nv_ + i];
  const double *v = u_.data(), *q = q_.data();
  s_.tree.inverse(q, v, dx + nv_, inertial_.data());
  s_.counts.G += s_.ng > 0;
  const bool has_friction = static_cast<bool>(s_.friction);
  constraints.dense_value(s_.tree, q, has_friction ? constraints.all : rows, G_);
  double* rates = R + 2 * nv_;
  s_.generalized_force(t, q, v, v + nv_, R + nv_, rates);
  if (has_friction) {
    std::fill(lam_.begin(), lam_.end(), 0.0);
    for (size_t i = 0; i < rows.size(); ++i) lam_[rows[i]] = z[i];
    s_.friction.update_slips(v);
    rates[ns_] += s_.friction.add(G_.data(), lam_.data(), R + nv_);
  }
  std::copy(v, v + nv_, R);
  s_.manifold.tangent(x, R);
  std::fill(gt_.begin(), gt_.end(), 0.0);
  constraints.evaluate_g_t(t, gt_.data());
  for (int i = 0; i < nv_; ++i) R[nv_ + i] -= inertial_[i];
  for (size_t i = 0; i < rows.size(); ++i) {
    const double* G = &G_[static_cast<size_t>(rows[i]) * nv_];
    double rate = gt_[rows[i]];
    for (int c : constraints.rows[rows[i]].columns) R[nv_ + c] += z[i] * G[c], rate += G[c] * v[c];
    C[i] = -rate;
    rates[ns_] -= z[i] * gt_[rows[i]];
  }
  for (int i = 0; i < nv_; ++i) R[i] -= dx[i];
  for (int i = 2 * nv_; i < ny_; ++i) R[i] -= dx[i];
}

std::shared_ptr<const LinearizedStages> CollocationStep::linearize(double t, const double* x, const double* dx,
                                                                   const double* z) {
  auto out = std::make_shared<LinearizedStages>();
  const std::vector<int>& rows = s_.rows.in_use();
  s_.manifold.integrate(y0_.data(), x, q_.data());
  for (int i = 0; i < nv_ + ns_ + 1; ++i) u_[i] = y0_[nq_ + i] + x[nv_ + i];
  std::fill(lam_.begin(), lam_.end(), 0.0);
  for (size_t i = 0; i < rows.size(); ++i) lam_[rows[i]] = z[i];
  s_.partials(t, q_.data(), u_.data(), dx + nv_, lam_.data(), out->partials);
  s_.manifold.partials(x, u_.data(), out->tangents);
  return out;
}

std::vector<std::shared_ptr<const StageSolver>> CollocationStep::factorize(
    const Radau& a, const std::shared_ptr<const LinearizedStages>& partials, double h) {
  std::vector<std::shared_ptr<const StageSolver>> out;
  for (const EigenMode& mode : a.modes) {
    s_.counts.factorizations += 1;
    out.push_back(make_stage_solver(partials, nv_, h * mode.value));
  }
  return out;
}

std::vector<int> CollocationStep::unknowns() const { return s_.rows.in_use(); }

void CollocationStep::all_multipliers(double, const double*, double* out) {
  s_.saddle.all_multipliers(lam_.data(), out);
}

}  // namespace mbdae
