// Recomputed stages of a half-explicit step, and sums over its tableau.
#include "sensitivity/step_sensitivity.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

StepSensitivity::StepSensitivity(Index2System& s, ParameterPartials* parameters, const Tableau& a, bool forward)
    : HalfExplicitStep(s), parameters_(parameters), forward_(forward && parameters && parameters->count()), a_(a) {}

void StepSensitivity::repeat(double t, double h, const State& in, State& out, bool partials) {
  const Tableau& a = a_;
  const int n = a.n, stride = stride_;
  const double* y = in.y.data();
  h_ = h, with_partials_ = partials;
  std::copy(y, y + nq_, q0_.begin()), std::copy(y + nq_, y + nq_ + nv_, v0_.begin());
  std::copy(y + nq_ + nv_, y + nq_ + nv_ + ns_, s0_.begin());
  if (F_.size() < static_cast<size_t>(n) * stride) F_.assign(static_cast<size_t>(n) * stride, 0.0);
  if (a.explicit_first) first_stage(in.carry, F_.data());
  while (partials && static_cast<int>(stages_.size()) < n) stages_.emplace_back(new StageSensitivity(s_));
  if (forward_) P_.resize(n), Q_.resize(n);
  for (int i = a.explicit_first; i < n; ++i) {
    const double stage_t = t + a.c[i] * h, t_hat = t + a.chat[i] * h, factor = h * a.Ahat[i * n + i];
    double* F = F_.data() + static_cast<size_t>(i) * stride;
    combine(&a.A[i * n], i, h, x_), combine(&a.Ahat[i * n], i, h, xhat_);
    stage(stage_t, t_hat, factor, F, false);
    if (partials) record_stage(i, stage_t, t_hat, factor, F);
  }
  combine(a.b.data(), n, h, x_);
  s_.manifold.check_rotations(x_.data());
  out.y.resize(s_.length);
  s_.add(y, x_.data(), out.y.data());
  if (a.explicit_first) set_carry(F_.data() + static_cast<size_t>(n - 1) * stride, out.carry);
  if (partials) s_.manifold.integrate_partials(x_.data(), x_.data(), end_);
}

void StepSensitivity::record_stage(int i, double t, double t_hat, double factor, const double* F) {
  StageSensitivity& k = *stages_[i];
  k.t = t, k.factor = factor;
  k.q = q_, k.vdot.assign(F + nv_, F + 2 * nv_);
  k.u.assign(nv_ + ns_ + 1, 0.0);
  std::copy(v_.begin(), v_.end(), k.u.begin()), std::copy(s_in_.begin(), s_in_.end(), k.u.begin() + nv_);
  k.lam.assign(s_.ng, 0.0);
  for (int row : s_.rows.in_use()) k.lam[row] = lam_[row];
  s_.manifold.integrate_partials(x_.data(), v_.data(), k.integrate_partials);
  const bool requested = parameters_ && parameters_->frames_move();
  if (!s_.rows.in_use().empty()) {
    k.constraint_points.resize(1);
    LinearizationPoint::ConstraintPoint& constrained = k.constraint_points[0];
    constrained.t = t_hat, constrained.kind = LinearizationPoint::ConstraintPoint::rate, constrained.weight = 1,
    constrained.q = qhat_, constrained.v.resize(nv_);
    for (int i = 0; i < nv_; ++i) constrained.v[i] = v0_[i] + xhat_[nv_ + i] + factor * k.vdot[i];
    k.Ghat = Ghat_, k.Zhat = Zhat_, k.lu = s_.saddle.factors();
    s_.manifold.integrate_partials(dx_.data(), constrained.v.data(), k.integrate_partials_hat);
    s_.closure_partials(qhat_.data(), constrained.v.data(), nullptr, nullptr, &k.Bhat, nullptr,
                        requested ? &constrained.wrench_partials : nullptr);
  }
  if (forward_) parameters_->rows(k, Q_[i], qhat_);
  k.point.exchange(s_.point);
  k.wrenches.clear();
  s_.force_partials(t, k.q.data(), k.u.data(), k.vdot.data(), k.lam.data(), k.partials, nullptr,
                    requested ? &k.wrenches : nullptr);
  if (forward_) parameters_->forces(k, P_[i]);
}

void StepSensitivity::forward(int directions, double* tangents, const double* dp, const double*, const double*) {
  const int n = a_.n, ny = ny_, nc = ny_ - nv_, r = static_cast<int>(s_.rows.in_use().size());
  const size_t k = forward_ ? parameters_->count() : 0, size = static_cast<size_t>(directions) * ny;
  const size_t width = ny + (a_.explicit_first ? nc : 0);
  const bool has_parameters = k > 0;
  dF_.assign(n * size, 0.0), x_bar_.resize(ny), xhat_bar_.resize(ny), P_dp_.resize(nc), Q_dp_.resize(r);
  if (a_.explicit_first)
    for (int d = 0; d < directions; ++d) {
      std::copy_n(tangents + d * width + nv_, nv_, &dF_[d * ny]);
      std::copy_n(tangents + d * width + ny, nc, &dF_[d * ny + nv_]);
    }
  for (int i = a_.explicit_first; i < n; ++i) {
    StageSensitivity& stage = *stages_[i];
    for (int d = 0; d < directions; ++d) {
      for (auto [target, weights] : {std::pair<Vector&, const Vector&>(x_bar_, a_.A), {xhat_bar_, a_.Ahat}}) {
        std::fill(target.begin(), target.end(), 0.0);
        for (int j = 0; j < i; ++j) {
          const double w = h_ * weights[i * n + j];
          const double* source = &dF_[j * size + d * ny];
          if (w != 0)
            for (int c = 0; c < ny; ++c) target[c] += w * source[c];
        }
      }
      if (has_parameters) {
        std::fill(P_dp_.begin(), P_dp_.end(), 0.0), std::fill(Q_dp_.begin(), Q_dp_.end(), 0.0);
        for (size_t l = 0; l < k; ++l) {
          const double w = dp[d * k + l];
          if (w == 0) continue;
          for (int c = 0; c < nc; ++c) P_dp_[c] += w * P_[i][l * nc + c];
          for (int c = 0; c < r; ++c) Q_dp_[c] += w * Q_[i][l * r + c];
        }
      }
      stage.forward(x_bar_.data(), xhat_bar_.data(), tangents + d * width, has_parameters ? P_dp_.data() : nullptr,
                    has_parameters ? Q_dp_.data() : nullptr, &dF_[i * size + d * ny]);
    }
  }
  Vector dq(nv_), rotated(nv_);
  for (int d = 0; d < directions; ++d) {
    std::fill(x_bar_.begin(), x_bar_.end(), 0.0);
    for (int j = 0; j < n; ++j)
      for (int c = 0; c < ny; ++c) x_bar_[c] += h_ * a_.b[j] * dF_[j * size + d * ny + c];
    double* target = tangents + d * width;
    apply(end_, &IntegratePartialsBlock::A, false, true, nv_, target, dq.data());
    apply(end_, &IntegratePartialsBlock::R, false, true, nv_, x_bar_.data(), rotated.data());
    for (int c = 0; c < nv_; ++c) target[c] = dq[c] + rotated[c];
    for (int c = nv_; c < ny; ++c) target[c] += x_bar_[c];
    if (a_.explicit_first) std::copy_n(&dF_[(n - 1) * size + d * ny + nv_], nc, target + ny);
  }
}

void StepSensitivity::reverse(int costs, double* cotangents) {
  const int n = a_.n, ny = ny_, nc = ny_ - nv_;
  const size_t width = ny + (a_.explicit_first ? nc : 0), size = static_cast<size_t>(n) * ny;
  Vector x(ny), out(costs * static_cast<size_t>(ny));
  dF_.assign(costs * size, 0.0);
  for (int d = 0; d < costs; ++d) {
    const double *bar = cotangents + d * width, *carry = bar + ny;
    double *y = &out[d * ny], *dF = &dF_[d * size];
    std::copy(bar, carry, y), std::copy(bar, carry, x.begin());
    apply(end_, &IntegratePartialsBlock::R, true, true, nv_, bar, x.data());
    apply(end_, &IntegratePartialsBlock::A, true, true, nv_, bar, y);
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < ny; ++c) dF[i * ny + c] = h_ * a_.b[i] * x[c];
    if (a_.explicit_first)
      for (int c = 0; c < nc; ++c) dF[(n - 1) * ny + nv_ + c] += carry[c];
  }
  for (int i = n - 1; i >= a_.explicit_first; --i) {
    StageSensitivity& stage = *stages_[i];
    upper_.clear(), nu_.clear();
    for (int d = 0; d < costs; ++d) {
      double* dF = &dF_[d * size];
      x_bar_.assign(ny, 0.0), xhat_bar_.assign(ny, 0.0);
      stage.reverse(dF + i * ny, x_bar_.data(), xhat_bar_.data(), &out[d * ny]);
      upper_.insert(upper_.end(), stage.upper.begin(), stage.upper.end());
      nu_.insert(nu_.end(), stage.nu.begin(), stage.nu.end());
      for (int j = 0; j < i; ++j) {
        const double w = h_ * a_.A[i * n + j], w_hat = h_ * a_.Ahat[i * n + j];
        if (w == 0 && w_hat == 0) continue;
        for (int c = 0; c < ny; ++c) dF[j * ny + c] += w * x_bar_[c] + w_hat * xhat_bar_[c];
      }
    }
    if (parameters_) parameters_->add_point(stage, upper_, nu_);
  }
  for (int d = 0; d < costs; ++d) {
    double *bar = cotangents + d * width, *y = &out[d * ny];
    const double* dF = &dF_[d * size];
    if (a_.explicit_first) {
      for (int c = 0; c < nv_; ++c) y[nv_ + c] += dF[c];
      std::copy_n(dF + nv_, nc, bar + ny);
    }
    std::copy_n(y, ny, bar);
  }
}

}  // namespace mbdae
