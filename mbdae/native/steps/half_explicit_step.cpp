// Stages of half-explicit methods: forces, stage constraint, saddle-point system.
#include "steps/half_explicit_step.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

constexpr int CHUNK = 8;  // entries of a block that stays in registers

}  // namespace

HalfExplicitStep::HalfExplicitStep(Index2System& s)
    : s_(s),
      nq_(s.nq),
      nv_(s.nv),
      ns_(s.ns),
      ny_(s.ny),
      stride_((s.ny + CHUNK - 1) / CHUNK * CHUNK),
      x_(stride_),
      xhat_(stride_),
      dx_(nv_),
      q0_(nq_),
      v0_(nv_),
      s0_(ns_),
      q_(nq_),
      v_(nv_),
      qhat_(nq_),
      s_in_(ns_),
      f_(nv_),
      lam_(s.ng),
      gt_(s.ng),
      gthat_(s.ng),
      work_(s.ng),
      Ghat_(s.point.G.size()),
      Zhat_(Ghat_.size()) {}

void HalfExplicitStep::set_stage_state() {
  s_.manifold.integrate(q0_.data(), x_.data(), q_.data());
  for (int i = 0; i < nv_; ++i) v_[i] = v0_[i] + x_[nv_ + i];
  for (int i = 0; i < ns_; ++i) s_in_[i] = s0_[i] + x_[2 * nv_ + i];
}

void HalfExplicitStep::stage(double t, double t_hat, double factor, double* F, bool last) {
  Configuration& point = s_.point;
  MultibodyTree& m = s_.tree;
  Constraints& constraints = s_.constraints;
  const std::vector<int>& rows = s_.rows.in_use();
  set_stage_state();
  point.dynamics(q_.data(), v_.data(), with_partials_);
  s_.counts.M += 1, s_.counts.factorizations += 1;
  const bool has_friction = static_cast<bool>(s_.friction);
  const std::vector<int>& selected = (last || has_friction) && !s_.rows.remaining().empty() ? constraints.all : rows;
  if (s_.ng) s_.counts.G += 1;
  constraints.value(m, q_.data(), selected, point.G.data(), point.g.data());
  if (has_friction) s_.friction.update_slips(v_.data());
  double* rates = F + 2 * nv_;
  s_.forces(t, q_.data(), v_.data(), s_in_.data(), f_.data(), rates, true);
  if (!rows.empty() && s_.driven())
    constraints.evaluate_g_t(t_hat, gthat_.data()), constraints.evaluate_g_t(t, gt_.data());
  if (last) {
    Index2System::LastStage& last_stage = s_.last_stage;
    last_stage.t = t, last_stage.q = q_, last_stage.v = v_, last_stage.s = s_in_, last_stage.f = f_,
    last_stage.motion_stamp = m.motion_stamp();
    last_stage.rates.assign(rates, rates + ns_ + 1);
  }
  point.scale_rows(selected);
  std::copy(v_.begin(), v_.end(), F);
  s_.manifold.tangent(x_.data(), F);
  if (!rows.empty()) {
    if (last) m.save_poses();
    satisfy_constraint(t_hat, factor, F);
    for (int k : rows) {
      double rate = gthat_[k];
      const double* G = Ghat_.data() + constraints.start[k];
      for (int c : constraints.rows[k].columns) rate += *G++ * (v0_[c] + xhat_[nv_ + c]);
      lam_[k] = -rate / factor;
    }
  } else if (s_.ng) {
    s_.counts.G += 1;
  }
  s_.solve(Zhat_, lam_.data(), f_.data(), rates + ns_);
  for (int k : rows) rates[ns_] -= lam_[k] * gt_[k];
  std::copy(f_.begin(), f_.end(), F + nv_);
  if (last) point.mark_current(q_.data());
}

void HalfExplicitStep::first_stage(const Vector& carry, double* F) const {
  std::copy(v0_.begin(), v0_.end(), F), std::copy(carry.begin(), carry.end(), F + nv_);
}

void HalfExplicitStep::set_carry(const double* F, Vector& carry) const { carry.assign(F + nv_, F + ny_); }

void HalfExplicitStep::all_multipliers(double* z) { s_.saddle.all_multipliers(lam_.data(), z); }

void HalfExplicitStep::evaluate_poses(const double* dx, double factor) {
  for (int i = 0; i < nv_; ++i) dx_[i] = xhat_[i] + factor * dx[i];
  s_.manifold.integrate(q0_.data(), dx_.data(), qhat_.data());
  s_.tree.poses(qhat_.data());
  s_.counts.G += 1;
}

void HalfExplicitStep::satisfy_constraint(double, double factor, double* dx) {
  evaluate_poses(dx, factor);
  factorize_constraints();
}

void HalfExplicitStep::factorize_constraints() {
  const std::vector<int>& rows = s_.rows.in_use();
  s_.constraints.value(s_.tree, qhat_.data(), rows, Ghat_.data());
  s_.point.scale_rows(rows, Ghat_, Zhat_);
  s_.saddle.factorize(Zhat_);
}

void HalfExplicitStep::combine(const double* weights, int count, double h, Vector& out) const {
  for (int k = 0; k < stride_; k += CHUNK) {
    const double* from = F_.data() + k;
    double sum[CHUNK] = {};
    for (int j = 0; j < count; ++j, from += stride_)
      if (const double w = weights[j]; w != 0)
        for (int i = 0; i < CHUNK; ++i) sum[i] += w * from[i];
    for (int i = 0; i < CHUNK; ++i) out[k + i] = h * sum[i];
  }
}

void HalfExplicitStep::project(double* e) {
  s_.counts.projections += 1;
  for (int k : s_.rows.in_use()) work_[k] = s_.constraints.times(k, s_.point.G, e + nv_);
  s_.saddle.minimum_norm_correction(work_.data(), f_.data());
  for (int i = 0; i < nv_; ++i) e[nv_ + i] -= f_[i];
}

void HalfExplicitStep::take(const Tableau& a, double t, double h, const State& in, State& out, double* z,
                            Vector& errors) {
  const int n = a.n, stride = stride_;
  const double* y = in.y.data();
  std::copy(y, y + nq_, q0_.begin()), std::copy(y + nq_, y + nq_ + nv_, v0_.begin());
  std::copy(y + nq_ + nv_, y + nq_ + nv_ + ns_, s0_.begin());
  IndependentRows& rows = s_.rows;
  s_.select_rows_of_step(y);
  begin_step(y);
  if (F_.size() < static_cast<size_t>(n) * stride) F_.assign(static_cast<size_t>(n) * stride, 0.0);
  double* F = F_.data();
  if (a.explicit_first) first_stage(in.carry, F);
  for (int i = a.explicit_first; i < n; ++i) {
    combine(&a.A[i * n], i, h, x_), combine(&a.Ahat[i * n], i, h, xhat_);
    stage(t + a.c[i] * h, t + a.chat[i] * h, h * a.Ahat[i * n + i], F + static_cast<size_t>(i) * stride, i == n - 1);
  }
  combine(a.b.data(), n, h, x_);
  s_.move(in, x_.data(), out);
  const double* end = F + static_cast<size_t>(n - 1) * stride;
  if (a.explicit_first) set_carry(end, out.carry);
  const bool projected = a.project_embedded && !rows.in_use().empty();
  if (projected || rows.dependent()) s_.saddle.factorize_symmetric();
  errors.resize(static_cast<size_t>(a.errors) * ny_);
  for (int i = 0; i < a.errors; ++i) {
    double* e = &errors[static_cast<size_t>(i) * ny_];
    combine(&a.error_weights[i * n], n, h, xhat_);
    std::copy_n(xhat_.data(), ny_, e);
    if (projected) project(e);
  }
  all_multipliers(z);
  s_.probe_other_rows();
}

void HalfExplicitStep::controlled(const Tableau& a, double t, double h, const State& in, State& out, double* z,
                                  Vector& errors) {
  if (!a.doubling_order) return take(a, t, h, in, out, z, errors);
  State full_step, half_step;
  Vector none;
  take(a, t, h, in, full_step, z, none);
  take(a, t, h / 2, in, half_step, z, none);
  take(a, t + h / 2, h / 2, half_step, out, z, none);
  errors.resize(ny_);
  s_.difference(full_step.y.data(), out.y.data(), errors.data());
  for (double& e : errors) e /= std::pow(2.0, a.doubling_order) - 1;
}

}  // namespace mbdae
