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

void GGLStep::begin(const Numbers& carry, double* F) const {
  HalfExplicitStep::begin(Numbers(carry.begin() + nv_, carry.end()), F);
  for (int i = 0; i < nv_; ++i) F[i] += carry[i];
}

void GGLStep::finish(const double* F, Numbers& carry) const {
  carry = slip_;
  carry.insert(carry.end(), F + nv_, F + ny_);
}

void GGLStep::stage(double t, double that, double factor, double* F, bool last) {
  std::copy_n(x_.begin(), nv_, at_.begin());
  std::fill(mu_.begin(), mu_.end(), 0.0), std::fill(slip_.begin(), slip_.end(), 0.0);
  HalfExplicitStep::stage(t, that, factor, F, last);
}

void GGLStep::meet(double that, double factor, double* dx) {
  const std::vector<int>& kept = positions_.kept();
  if (kept.empty()) return HalfExplicitStep::meet(that, factor, dx);
  const Tolerances& limits = s_.mechanics.limits;
  const double scale = 1 + largest_scaled(q0_.data(), limits.q_scales);
  double last = INFINITY;
  for (int k = 0; k < limits.ggl_iterations; ++k) {
    place(dx, factor);
    std::fill(gap_.begin(), gap_.end(), 0.0);
    s_.constraints.value(s_.mechanics, q_met_.data(), kept, Ghat_.data(), gap_.data());
    s_.constraints.gaps(that, gap_.data());
    for (int r : kept) gap_[r] /= -factor;
    correct(Ghat_);
    const double size = std::fabs(factor) * largest_scaled(move_.data(), limits.coordinate_scales);
    if (!std::isfinite(size)) throw StepTooLong();
    if (size <= limits.rounding * scale || (size > 0.5 * last && size <= limits.search_tolerance * scale)) {
      if (!positions_.shared) meet_velocities();
      return watch(that);
    }
    if (s_.manifold.curved()) {
      if (!k) s_.manifold.transfer(at_.data(), dx_.data(), transfer_);
      transfer();
      correct(Gmet_);
    }
    for (int r : kept) mu_[r] += dmu_[r];
    for (int i = 0; i < nv_; ++i) slip_[i] += dslip_[i], dx[i] += move_[i];
    last = size;
  }
  throw StepTooLong();
}

void GGLStep::correct(const Numbers& G) {
  for (int r : positions_.kept()) s_.point.scale(r, G, Zhat_);
  positions_.saddle().factorize(Zhat_);
  positions_.saddle().normal(gap_.data(), dslip_.data(), dmu_.data());
  move_ = dslip_;
  s_.manifold.tangent(at_.data(), move_.data());
}

void GGLStep::transfer() {
  Gmet_ = Ghat_;
  for (int r : positions_.kept())
    for (const TangentBlock& b : transfer_)
      for (int j = 0; j < b.n; ++j) {
        const double* row = &Ghat_[static_cast<size_t>(r) * nv_ + b.at];
        double s = 0;
        for (int i = 0; i < b.n; ++i) s += row[i] * b.J[i * b.n + j];
        Gmet_[static_cast<size_t>(r) * nv_ + b.at + j] = s;
      }
}

void GGLStep::watch(double that) {
  const std::vector<int>& others = positions_.rows().others();
  if (others.empty()) return;
  std::fill(gap_.begin(), gap_.end(), 0.0);
  s_.constraints.value(s_.mechanics, q_met_.data(), others, Ghat_.data(), gap_.data());
  s_.constraints.gaps(that, gap_.data());
  const Tolerances& limits = s_.mechanics.limits;
  for (int r : others)
    if (std::fabs(gap_[r]) > limits.same_state * limits.row_scales[r]) throw FallBackToPython();
}

void GGLStep::project(double* e) {
  HalfExplicitStep::project(e);
  move_.assign(e, e + nv_);
  s_.manifold.velocity(at_.data(), move_.data());
  if (!positions_.shared) positions_.saddle().symmetric();
  for (int k : positions_.kept()) {
    work_[k] = 0;
    for (int c : s_.constraints.rows[k].columns) work_[k] += s_.point.G[static_cast<size_t>(k) * nv_ + c] * move_[c];
  }
  positions_.saddle().normal(work_.data(), move_.data());
  s_.manifold.tangent(at_.data(), move_.data());
  for (int i = 0; i < nv_; ++i) e[i] -= move_[i];
}

void GGLStep::all_multipliers(double* z) {
  HalfExplicitStep::all_multipliers(z);
  if (!positions_.shared && positions_.rows().dependent()) positions_.saddle().symmetric();
  positions_.saddle().all_multipliers(mu_.data(), z + s_.ng);
}

}  // namespace mbdae
