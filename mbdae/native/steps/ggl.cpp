// Newton's method for mu at each stage of a half-explicit GGL step.
#include "steps/ggl.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

GGLStep::GGLStep(Index2System& s)
    : HalfExplicitStep(s),
      positions_(s),
      mu_(s.ng),
      mu_velocity_(nv_),
      g_(s.ng),
      dmu_(s.ng),
      dmu_velocity_(nv_),
      move_(nv_),
      stage_x_(nv_) {}

void GGLStep::first_stage(const Vector& carry, double* F) const {
  HalfExplicitStep::first_stage(Vector(carry.begin() + nv_, carry.end()), F);
  for (int i = 0; i < nv_; ++i) F[i] += carry[i];
}

void GGLStep::set_carry(const double* F, Vector& carry) const {
  carry = mu_velocity_;
  carry.insert(carry.end(), F + nv_, F + ny_);
}

void GGLStep::stage(double t, double t_hat, double factor, double* F, bool last) {
  std::copy_n(x_.begin(), nv_, stage_x_.begin());
  std::fill(mu_.begin(), mu_.end(), 0.0), std::fill(mu_velocity_.begin(), mu_velocity_.end(), 0.0);
  HalfExplicitStep::stage(t, t_hat, factor, F, last);
}

void GGLStep::satisfy_constraint(double t_hat, double factor, double* dx) {
  const std::vector<int>& rows = positions_.in_use();
  if (rows.empty()) return HalfExplicitStep::satisfy_constraint(t_hat, factor, dx);
  const Tolerances& tolerances = s_.tree.tolerances;
  const double scale = 1 + largest_scaled(q0_.data(), tolerances.q_scales);
  double last = INFINITY;
  for (int k = 0; k < tolerances.ggl_iterations; ++k) {
    evaluate_poses(dx, factor);
    std::fill(g_.begin(), g_.end(), 0.0);
    s_.constraints.value(s_.tree, qhat_.data(), rows, Ghat_.data(), g_.data());
    s_.constraints.complete_g(t_hat, g_.data());
    for (int r : rows) g_[r] /= -factor;
    compute_correction(Ghat_);
    const double size = std::fabs(factor) * largest_scaled(move_.data(), tolerances.coordinate_scales);
    if (!std::isfinite(size)) throw StepTooLong();
    if (size <= tolerances.rounding * scale || (size > 0.5 * last && size <= tolerances.search_tolerance * scale)) {
      if (!positions_.same_as_velocity_rows) factorize_constraints();
      return check_other_rows(t_hat);
    }
    if (s_.manifold.curved()) {
      if (!k) s_.manifold.transfer(stage_x_.data(), dx_.data(), transfer_);
      transfer();
      compute_correction(G_transferred_);
    }
    for (int r : rows) mu_[r] += dmu_[r];
    for (int i = 0; i < nv_; ++i) mu_velocity_[i] += dmu_velocity_[i], dx[i] += move_[i];
    last = size;
  }
  throw StepTooLong();
}

void GGLStep::compute_correction(const Vector& G) {
  s_.point.scale_rows(positions_.in_use(), G, Zhat_);
  positions_.saddle().factorize(Zhat_);
  positions_.saddle().minimum_norm_correction(g_.data(), dmu_velocity_.data(), dmu_.data());
  move_ = dmu_velocity_;
  s_.manifold.tangent(stage_x_.data(), move_.data());
}

void GGLStep::transfer() {
  G_transferred_ = Ghat_;
  for (int r : positions_.in_use()) {
    const std::vector<int>& columns = s_.constraints.rows[r].columns;
    const size_t start = s_.constraints.start[r];
    for (const TangentBlock& b : transfer_) {
      const auto first = std::lower_bound(columns.begin(), columns.end(), b.start);
      if (first == columns.end() || *first != b.start) continue;  // a row contains all columns of a joint, or none
      const size_t entry = start + (first - columns.begin());
      for (int j = 0; j < b.n; ++j) {
        double s = 0;
        for (int i = 0; i < b.n; ++i) s += Ghat_[entry + i] * b.J[i * b.n + j];
        G_transferred_[entry + j] = s;
      }
    }
  }
}

void GGLStep::check_other_rows(double t_hat) {
  const std::vector<int>& others = positions_.rows().remaining();
  if (others.empty()) return;
  std::fill(g_.begin(), g_.end(), 0.0);
  s_.constraints.value(s_.tree, qhat_.data(), others, Ghat_.data(), g_.data());
  s_.constraints.complete_g(t_hat, g_.data());
  const Tolerances& tolerances = s_.tree.tolerances;
  for (int r : others)
    if (std::fabs(g_[r]) > tolerances.same_state * tolerances.row_scales[r]) throw FallBackToPython();
}

void GGLStep::project(double* e) {
  HalfExplicitStep::project(e);
  move_.assign(e, e + nv_);
  s_.manifold.velocity(stage_x_.data(), move_.data());
  if (!positions_.same_as_velocity_rows) positions_.saddle().factorize_symmetric();
  for (int k : positions_.in_use()) work_[k] = s_.constraints.times(k, s_.point.G, move_.data());
  positions_.saddle().minimum_norm_correction(work_.data(), move_.data());
  s_.manifold.tangent(stage_x_.data(), move_.data());
  for (int i = 0; i < nv_; ++i) e[i] -= move_[i];
}

void GGLStep::all_multipliers(double* z) {
  HalfExplicitStep::all_multipliers(z);
  if (!positions_.same_as_velocity_rows && positions_.rows().dependent()) positions_.saddle().factorize_symmetric();
  positions_.saddle().all_multipliers(mu_.data(), z + s_.ng);
}

}  // namespace mbdae
