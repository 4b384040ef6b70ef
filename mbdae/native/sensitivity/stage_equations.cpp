// Partials of the equations of a stage: stage constraint, motion, friction, GGL position constraint.
#include "sensitivity/stage_equations.hpp"

#include <algorithm>

namespace mbdae {

namespace {

using Blocks = std::vector<IntegratePartialsBlock>;

// a := a B, where B is block diagonal, and the identity outside its blocks.
template <class A>
void multiply_blocks(A&& a, const Blocks& blocks, double (IntegratePartialsBlock::*B)[36]) {
  for (const IntegratePartialsBlock& b : blocks) {
    const ConstMatrixMap m(b.*B, b.n, b.n);
    a.middleCols(b.start, b.n) = a.middleCols(b.start, b.n).lazyProduct(m).eval();
  }
}

}  // namespace

StageEquations::StageEquations(Index2System& s, ParameterPartials& parameters, bool forward)
    : s_(s), parameters_(parameters), forward_(forward && parameters.count()), n_(s.ny - s.nv) {}

void StageEquations::take(const double* y0, const StageValues& stage, const IndependentRows* position_rows) {
  const int nv = s_.nv, ny = s_.ny;
  position_rows_ = position_rows;
  r_ = static_cast<int>(s_.rows.in_use().size()),
  k_ = position_rows_ ? static_cast<int>(position_rows_->in_use().size()) : 0;
  m_ = ny + r_ + (position_rows_ ? nv + k_ : 0);
  unknown_partials.setZero(m_, m_), x.setZero(m_, ny), xhat.setZero(m_, 2 * nv), y.setZero(m_, ny);
  t.setZero(m_), t_hat.setZero(m_);
  if (forward_) p.setZero(m_, static_cast<int>(parameters_.count()));
  for (LinearizationPoint* point : {&point_, &mu_point_}) point->constraint_points.clear(), point->wrenches.clear();
  constraints(y0, stage);
  motion(y0, stage);
  if (position_rows_) positions(stage);
  multiply_blocks(y.leftCols(nv), integrate_partials_, &IntegratePartialsBlock::A);
  multiply_blocks(x.leftCols(nv), integrate_partials_, &IntegratePartialsBlock::R);
  // terms of the constraint point, whose coordinates are xhat
  Rows<double> hat = xhat.leftCols(nv);
  multiply_blocks(xhat.leftCols(nv), integrate_partials_hat_, &IntegratePartialsBlock::R),
      multiply_blocks(hat, integrate_partials_hat_, &IntegratePartialsBlock::A);
  y.leftCols(nv) += hat, y.middleCols(nv, nv) += xhat.rightCols(nv);
  x.topLeftCorner(nv, nv).setZero();
  for (const IntegratePartialsBlock& b : integrate_partials_) {
    x.block(b.start, b.start, b.n, b.n) = -ConstMatrixMap(b.T, b.n, b.n);
    x.block(b.start, nv + b.start, b.n, b.n) = -ConstMatrixMap(b.J, b.n, b.n);
  }
  y.middleCols(nv, nv).topRows(nv) = x.middleCols(nv, nv).topRows(nv);
  if (position_rows_) unknown_partials.block(0, ny + r_, nv, nv) = x.middleCols(nv, nv).topRows(nv);
  s_.point.invalidate();
}

void StageEquations::constraints(const double* y0, const StageValues& stage) {
  const int nv = s_.nv, nq = s_.nq, ny = s_.ny;
  const bool requested = parameters_.frames_move();
  LinearizationPoint::ConstraintPoint constrained{stage.t_hat, Vector(nq), Vector(nv),
                                                  LinearizationPoint::ConstraintPoint::rate, 1};
  s_.manifold.integrate(y0, stage.xhat.data(), constrained.q.data());
  for (int i = 0; i < nv; ++i) constrained.v[i] = y0[nq + i] + stage.xhat[nv + i];
  s_.manifold.integrate_partials(stage.xhat.data(), constrained.v.data(), integrate_partials_hat_);
  s_.tree.poses(constrained.q.data());
  G_.assign(static_cast<size_t>(s_.ng) * nv, 0.0);
  s_.constraints.dense_value(s_.tree, constrained.q.data(), s_.constraints.all, G_);
  s_.closure_partials(constrained.q.data(), constrained.v.data(), nullptr, nullptr, &Bhat_, nullptr,
                      requested ? &constrained.wrench_partials : nullptr);
  time_.assign(s_.ng, 0.0);
  s_.constraints.evaluate_g_tt(stage.t_hat, time_.data());
  for (int k : s_.rows.in_use()) {
    const int i = s_.rows.position()[k];
    xhat.row(ny + i).head(nv) = ConstMatrixMap(&Bhat_[static_cast<size_t>(i) * nv], 1, nv);
    xhat.row(ny + i).tail(nv) = ConstMatrixMap(&G_[static_cast<size_t>(k) * nv], 1, nv);
    t_hat[ny + i] = time_[k];
  }
  point_.constraint_points.push_back(std::move(constrained));
  if (forward_) {
    parameters_.rows(point_, Q_, point_.constraint_points[0].q);
    p.middleRows(ny, r_) = ConstMatrixMap(Q_.data(), p.cols(), r_).transpose();
  }
  if (!position_rows_) return;
  const LinearizationPoint::ConstraintPoint& constraint_point = point_.constraint_points[0];
  mu_point_.rows = position_rows_;
  mu_point_.constraint_points.push_back(
      {stage.t_hat, constraint_point.q, constraint_point.v, LinearizationPoint::ConstraintPoint::g, 1});
  time_.assign(s_.ng, 0.0);
  s_.constraints.evaluate_g_t(stage.t_hat, time_.data());
  const int first = ny + r_ + nv;
  for (int k : position_rows_->in_use()) {
    const int i = first + position_rows_->position()[k];
    xhat.row(i).head(nv) = ConstMatrixMap(&G_[static_cast<size_t>(k) * nv], 1, nv);
    t_hat[i] = time_[k];
  }
  if (!forward_) return;
  parameters_.rows(mu_point_, Q_, constraint_point.q);
  p.middleRows(first, k_) = ConstMatrixMap(Q_.data(), p.cols(), k_).transpose();
}

void StageEquations::motion(const double* y0, const StageValues& stage) {
  const int nv = s_.nv, nq = s_.nq, ny = s_.ny;
  LinearizationPoint& o = point_;
  o.t = stage.t, o.q.resize(nq), o.u.assign(n_, 0.0), o.vdot.assign(&stage.F[nv], &stage.F[2 * nv]), o.lam = stage.lam;
  s_.manifold.integrate(y0, stage.x.data(), o.q.data());
  for (int i = 0; i < nv + s_.ns; ++i) o.u[i] = y0[nq + i] + stage.x[nv + i];
  Vector total_v(o.u.begin(), o.u.begin() + nv);
  for (int i = 0; position_rows_ && i < nv; ++i) total_v[i] += stage.mu_velocity[i];
  s_.manifold.integrate_partials(stage.x.data(), total_v.data(), integrate_partials_);
  s_.force_partials(stage.t, o.q.data(), o.u.data(), o.vdot.data(), o.lam.data(), partials_, nullptr,
                    parameters_.frames_move() ? &o.wrenches : nullptr);
  std::fill(G_.begin(), G_.end(), 0.0);
  s_.constraints.dense_value(s_.tree, o.q.data(), s_.constraints.all, G_);
  unknown_partials.topLeftCorner(ny, ny).setIdentity();
  M_.resize(static_cast<size_t>(nv) * nv), s_.tree.dense_M(M_.data());
  unknown_partials.block(nv, nv, nv, nv) = ConstMatrixMap(M_.data(), nv, nv);
  x.block(0, nv, nv, nv) = -Rows<double>::Identity(nv, nv);
  x.block(nv, 0, n_, nv) = -ConstMatrixMap(partials_.K.data(), n_, nv),
                     x.block(nv, nv, n_, n_) = -ConstMatrixMap(partials_.D.data(), n_, n_);
  for (int k : s_.rows.in_use()) {
    const int i = s_.rows.position()[k];
    unknown_partials.block(nv, ny + i, nv, 1) = -ConstMatrixMap(&G_[static_cast<size_t>(k) * nv], 1, nv).transpose();
    unknown_partials(ny - 1, ny + i) = partials_.g_t[i];
  }
  if (s_.friction) friction();
  y.topRows(ny) = x.topRows(ny);
  Vector f_t(n_);
  s_.time_partials(stage.t, o.q.data(), o.u.data(), o.lam.data(), f_t.data());
  t.segment(nv, n_) = -Eigen::Map<const Eigen::VectorXd>(f_t.data(), n_);
  if (!forward_) return;
  parameters_.forces(o, P_);
  p.middleRows(nv, n_) -= ConstMatrixMap(P_.data(), p.cols(), n_).transpose();
}

void StageEquations::friction() {
  const int nv = s_.nv, ny = s_.ny;
  const size_t n = n_;
  if (!parameters_.friction) throw FallBackToPython();
  s_.friction.update_slips(point_.u.data());
  s_.friction.partials(G_.data(), point_.lam.data(), partials_.friction);
  for (int i = 0; i < r_; ++i) {
    const ConstMatrixMap friction_partials(&partials_.friction[static_cast<size_t>(i) * (nv + 1)], 1, nv + 1);
    unknown_partials.block(nv, ny + i, nv, 1) -= friction_partials.leftCols(nv).transpose();
    unknown_partials(ny - 1, ny + i) -= friction_partials(0, nv);
  }
  Vector K(n * nv), D(n * n);
  friction_columns_.resize(parameters_.count() * n);
  parameters_.friction(point_.q, Vector(point_.u.begin(), point_.u.begin() + nv), point_.lam, K, D, friction_columns_);
  x.block(nv, 0, n_, nv) -= ConstMatrixMap(K.data(), n_, nv),
      x.block(nv, nv, n_, n_) -= ConstMatrixMap(D.data(), n_, n_);
  if (forward_) p.middleRows(nv, n_) -= ConstMatrixMap(friction_columns_.data(), p.cols(), n_).transpose();
}

void StageEquations::positions(const StageValues& stage) {
  const int nv = s_.nv, ny = s_.ny, first = ny + r_;
  const Vector zero(nv, 0.0);
  LinearizationPoint& o = mu_point_;
  o.has_applied_forces = false, o.t = stage.t, o.q = point_.q, o.u.assign(n_, 0.0), o.vdot = stage.mu_velocity, o.lam = stage.mu;
  unknown_partials.block(first, first, nv, nv) = unknown_partials.block(nv, nv, nv, nv);
  for (int k : position_rows_->in_use()) {
    const ConstMatrixMap row(&G_[static_cast<size_t>(k) * nv], 1, nv);
    unknown_partials.block(first, first + nv + position_rows_->position()[k], nv, 1) = -row.transpose();
  }
  dtau_dq_.assign(static_cast<size_t>(nv) * nv, 0.0), dtau_dv_ = dtau_dq_;
  Vector dPmu_dq(dtau_dq_);
  s_.closure_partials(o.q.data(), zero.data(), o.lam.data(), dPmu_dq.data(), nullptr,
                      parameters_.frames_move() ? &o.wrenches : nullptr, nullptr, position_rows_);
  s_.tree.partials(o.q.data(), zero.data(), stage.mu_velocity.data(), dtau_dq_.data(), dtau_dv_.data(), true);
  x.block(first, 0, nv, nv) = ConstMatrixMap(dtau_dq_.data(), nv, nv) - ConstMatrixMap(dPmu_dq.data(), nv, nv);
  y.block(first, 0, nv, nv) = x.block(first, 0, nv, nv);
  if (!forward_) return;
  parameters_.forces(o, P_);
  p.middleRows(first, nv) = -ConstMatrixMap(P_.data(), p.cols(), n_).leftCols(nv).transpose();
}

void StageEquations::add_parameters(const Eigen::MatrixXd& equation_cotangents) {
  const int nv = s_.nv, ny = s_.ny;
  Vector force_cotangents, row_cotangents;
  // cotangents of forces, and of rows with opposite sign
  const auto gather = [&](int first, int size, int rows, int last) {
    force_cotangents.clear(), row_cotangents.clear();
    for (int c = 0; c < equation_cotangents.cols(); ++c) {
      const double* column = equation_cotangents.col(c).data();
      force_cotangents.insert(force_cotangents.end(), column + first, column + first + size),
          force_cotangents.resize((c + 1) * n_, 0.0);
      for (int k = rows; k < last; ++k) row_cotangents.push_back(-column[k]);
    }
  };
  gather(nv, ny - nv, ny, ny + r_);
  parameters_.add_point(point_, force_cotangents, row_cotangents);
  if (!friction_columns_.empty()) parameters_.add_columns(friction_columns_, force_cotangents);
  if (!position_rows_) return;
  gather(ny + r_, nv, ny + r_ + nv, m_);
  parameters_.add_point(mu_point_, force_cotangents, row_cotangents);
}

}  // namespace mbdae
