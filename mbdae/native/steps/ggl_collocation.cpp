// Stage residuals and linearization with the additional unknown mu.
#include "steps/ggl_collocation.hpp"

#include <algorithm>

#include "math/dense_lu.hpp"
#include "math/vec3.hpp"

namespace mbdae {

GGLCollocation::GGLCollocation(Index2System& s)
    : CollocationStep(s), positions_(s), g_(s.ng), mu_(s.ng), mu_velocity_(s.nv) {}

std::vector<int> GGLCollocation::unknowns() const {
  std::vector<int> out = CollocationStep::unknowns();
  out.insert(out.end(), positions_.in_use().begin(), positions_.in_use().end());
  return out;
}

std::shared_ptr<const LinearizedStages> GGLCollocation::linearize(double t, const double* x, const double* dx,
                                                                  const double* z) {
  auto out = std::make_shared<LinearizedStages>(*CollocationStep::linearize(t, x, dx, z));
  s_.tree.poses(q_.data());
  s_.constraints.dense_value(s_.tree, q_.data(), positions_.in_use(), G_);
  for (int k : positions_.in_use()) {
    const double* row = &G_[static_cast<size_t>(k) * nv_];
    out->P.insert(out->P.end(), row, row + nv_);
  }
  DenseLU<1> M;
  M.resize(nv_);
  for (int j = 0; j < nv_; ++j) std::copy_n(&out->partials.M[static_cast<size_t>(j) * nv_], nv_, M.column(j));
  if (!M.factorize()) throw FallBackToPython();
  out->N = out->P;
  for (size_t row = 0; row < out->N.size(); row += nv_) M.solve(&out->N[row]);
  return out;
}

void GGLCollocation::residual(double t, const double* x, const double* dx, const double* z, double* R, double* C) {
  CollocationStep::residual(t, x, dx, z, R, C);
  const std::vector<int>& rows = positions_.in_use();
  const size_t r = s_.rows.in_use().size();
  s_.counts.M += 1, s_.counts.factorizations += 1, s_.counts.G += s_.ng > 0;
  s_.point.inertia(q_.data());
  std::fill(g_.begin(), g_.end(), 0.0), std::fill(mu_velocity_.begin(), mu_velocity_.end(), 0.0);
  s_.constraints.dense_value(s_.tree, q_.data(), rows, G_, g_.data());
  s_.constraints.complete_g(t, g_.data());
  for (size_t i = 0; i < rows.size(); ++i) {
    C[r + i] = -g_[rows[i]];
    for (int c : s_.constraints.rows[rows[i]].columns)
      mu_velocity_[c] += z[r + i] * G_[static_cast<size_t>(rows[i]) * nv_ + c];
  }
  s_.point.solve_root(mu_velocity_.data()), s_.point.solve_root_transposed(mu_velocity_.data());
  s_.manifold.tangent(x, mu_velocity_.data());
  for (int i = 0; i < nv_; ++i) R[i] += mu_velocity_[i];
}

void GGLCollocation::all_multipliers(double t, const double* z, double* out) {
  CollocationStep::all_multipliers(t, z, out);
  const std::vector<int>& rows = positions_.in_use();
  g_ = s_.point.g;
  s_.constraints.complete_g(t, g_.data());
  const Tolerances& tolerances = s_.tree.tolerances;
  if (largest_scaled(g_.data(), tolerances.row_scales) > tolerances.same_state) throw FallBackToPython();
  std::fill(mu_.begin(), mu_.end(), 0.0);
  for (size_t i = 0; i < rows.size(); ++i) mu_[rows[i]] = z[s_.rows.in_use().size() + i];
  if (!positions_.same_as_velocity_rows && positions_.rows().dependent()) positions_.saddle().factorize_symmetric();
  positions_.saddle().all_multipliers(mu_.data(), out + s_.ng);
}

}  // namespace mbdae
