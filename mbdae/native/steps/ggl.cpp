#include "steps/ggl.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

GGLStep::GGLStep(Index2System& s)
    : HalfExplicitStep(s),
      positions_(s),
      mu_(s.ng),
      slip_(nv_),
      gap_(s.ng),
      dmu_(s.ng),
      dslip_(nv_),
      move_(nv_),
      at_(nv_) {}

void GGLStep::first_stage(const Vector& carry, double* F) const {
  HalfExplicitStep::first_stage(Vector(carry.begin() + nv_, carry.end()), F);
  for (int i = 0; i < nv_; ++i) F[i] += carry[i];
}

void GGLStep::set_carry(const double* F, Vector& carry) const {
  carry = slip_;
  carry.insert(carry.end(), F + nv_, F + ny_);
}

void GGLStep::stage(double t, double that, double factor, double* F, bool last) {
  std::copy_n(x_.begin(), nv_, at_.begin());
  std::fill(mu_.begin(), mu_.end(), 0.0), std::fill(slip_.begin(), slip_.end(), 0.0);
  HalfExplicitStep::stage(t, that, factor, F, last);
}

void GGLStep::satisfy_constraint(double that, double factor, double* dx) {
  const std::vector<int>& kept = positions_.in_use();
  if (kept.empty()) return HalfExplicitStep::satisfy_constraint(that, factor, dx);
  const Tolerances& limits = s_.tree.limits;
  const double scale = 1 + largest_scaled(q0_.data(), limits.q_scales);
  double last = INFINITY;
  for (int k = 0; k < limits.ggl_iterations; ++k) {
    evaluate_poses(dx, factor);
    std::fill(gap_.begin(), gap_.end(), 0.0);
    s_.constraints.value(s_.tree, qhat_.data(), kept, Ghat_.data(), gap_.data());
    s_.constraints.complete_g(that, gap_.data());
    for (int r : kept) gap_[r] /= -factor;
    compute_correction(Ghat_);
    const double size = std::fabs(factor) * largest_scaled(move_.data(), limits.coordinate_scales);
    if (!std::isfinite(size)) throw StepTooLong();
    if (size <= limits.rounding * scale || (size > 0.5 * last && size <= limits.search_tolerance * scale)) {
      if (!positions_.same_as_velocity_rows) factorize_constraints();
      return check_other_rows(that);
    }
    if (s_.manifold.curved()) {
      if (!k) s_.manifold.transfer(at_.data(), dx_.data(), transfer_);
      transfer();
      compute_correction(Gmoved_);
    }
    for (int r : kept) mu_[r] += dmu_[r];
    for (int i = 0; i < nv_; ++i) slip_[i] += dslip_[i], dx[i] += move_[i];
    last = size;
  }
  throw StepTooLong();
}

void GGLStep::compute_correction(const Vector& G) {
  s_.point.scale_rows(positions_.in_use(), G, Zhat_);
  positions_.saddle().factorize(Zhat_);
  positions_.saddle().minimum_norm_correction(gap_.data(), dslip_.data(), dmu_.data());
  move_ = dslip_;
  s_.manifold.tangent(at_.data(), move_.data());
}

void GGLStep::transfer() {
  Gmoved_ = Ghat_;
  for (int r : positions_.in_use()) {
    const std::vector<int>& columns = s_.constraints.rows[r].columns;
    const size_t start = s_.constraints.start[r];
    for (const TangentBlock& b : transfer_) {
      const auto first = std::lower_bound(columns.begin(), columns.end(), b.at);
      if (first == columns.end() || *first != b.at) continue;  // a row has all columns of a joint, or none
      const size_t at = start + (first - columns.begin());
      for (int j = 0; j < b.n; ++j) {
        double s = 0;
        for (int i = 0; i < b.n; ++i) s += Ghat_[at + i] * b.J[i * b.n + j];
        Gmoved_[at + j] = s;
      }
    }
  }
}

void GGLStep::check_other_rows(double that) {
  const std::vector<int>& others = positions_.rows().others();
  if (others.empty()) return;
  std::fill(gap_.begin(), gap_.end(), 0.0);
  s_.constraints.value(s_.tree, qhat_.data(), others, Ghat_.data(), gap_.data());
  s_.constraints.complete_g(that, gap_.data());
  const Tolerances& limits = s_.tree.limits;
  for (int r : others)
    if (std::fabs(gap_[r]) > limits.same_state * limits.row_scales[r]) throw FallBackToPython();
}

void GGLStep::project(double* e) {
  HalfExplicitStep::project(e);
  move_.assign(e, e + nv_);
  s_.manifold.velocity(at_.data(), move_.data());
  if (!positions_.same_as_velocity_rows) positions_.saddle().factorize_symmetric();
  for (int k : positions_.in_use()) work_[k] = s_.constraints.times(k, s_.point.G, move_.data());
  positions_.saddle().minimum_norm_correction(work_.data(), move_.data());
  s_.manifold.tangent(at_.data(), move_.data());
  for (int i = 0; i < nv_; ++i) e[i] -= move_[i];
}

void GGLStep::all_multipliers(double* z) {
  HalfExplicitStep::all_multipliers(z);
  if (!positions_.same_as_velocity_rows && positions_.rows().dependent()) positions_.saddle().factorize_symmetric();
  positions_.saddle().all_multipliers(mu_.data(), z + s_.ng);
}

}  // namespace mbdae
