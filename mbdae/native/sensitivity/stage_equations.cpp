#include "sensitivity/stage_equations.hpp"

#include <algorithm>

namespace mbdae {

namespace {

using Blocks = std::vector<IntegratePartialsBlock>;

// a := a B of the block diagonal B in columns from `at` on, with 1 outside its blocks.
template <class A>
void times(A&& a, const Blocks& blocks, double (IntegratePartialsBlock::*B)[36]) {
  for (const IntegratePartialsBlock& b : blocks) {
    const RowsIn m(b.*B, b.n, b.n);
    a.middleCols(b.at, b.n) = a.middleCols(b.at, b.n).lazyProduct(m).eval();
  }
}

}  // namespace

StageEquations::StageEquations(Index2System& s, ParameterPartials& parameters, bool forward)
    : s_(s), parameters_(parameters), forward_(forward && parameters.count()), n_(s.ny - s.nv) {}

void StageEquations::take(const double* y0, const StageValues& at, const IndependentRows* position_rows) {
  const int nv = s_.nv, ny = s_.ny;
  position_rows_ = position_rows;
  r_ = static_cast<int>(s_.rows.in_use().size()),
  k_ = position_rows_ ? static_cast<int>(position_rows_->in_use().size()) : 0;
  m_ = ny + r_ + (position_rows_ ? nv + k_ : 0);
  by_unknowns.setZero(m_, m_), x.setZero(m_, ny), xhat.setZero(m_, 2 * nv), y.setZero(m_, ny);
  t.setZero(m_), that.setZero(m_);
  if (forward_) p.setZero(m_, static_cast<int>(parameters_.count()));
  for (LinearizationPoint* one : {&point_, &slip_}) one->constraint_points.clear(), one->wrenches.clear();
  constraints(y0, at);
  motion(y0, at);
  if (position_rows_) positions(at);
  times(y.leftCols(nv), integrate_partials_, &IntegratePartialsBlock::A);
  times(x.leftCols(nv), integrate_partials_, &IntegratePartialsBlock::R);
  // terms of the constraint point, whose coordinates are xhat
  Rows<double> hat = xhat.leftCols(nv);
  times(xhat.leftCols(nv), integrate_partials_hat_, &IntegratePartialsBlock::R),
      times(hat, integrate_partials_hat_, &IntegratePartialsBlock::A);
  y.leftCols(nv) += hat, y.middleCols(nv, nv) += xhat.rightCols(nv);
  x.topLeftCorner(nv, nv).setZero();
  for (const IntegratePartialsBlock& b : integrate_partials_) {
    x.block(b.at, b.at, b.n, b.n) = -RowsIn(b.T, b.n, b.n);
    x.block(b.at, nv + b.at, b.n, b.n) = -RowsIn(b.J, b.n, b.n);
  }
  y.middleCols(nv, nv).topRows(nv) = x.middleCols(nv, nv).topRows(nv);
  if (position_rows_) by_unknowns.block(0, ny + r_, nv, nv) = x.middleCols(nv, nv).topRows(nv);
  s_.point.invalidate();
}

void StageEquations::constraints(const double* y0, const StageValues& at) {
  const int nv = s_.nv, nq = s_.nq, ny = s_.ny;
  const bool requested = parameters_.frames_move();
  LinearizationPoint::ConstraintPoint constrained{at.that, Vector(nq), Vector(nv),
                                                  LinearizationPoint::ConstraintPoint::rate, 1};
  s_.manifold.integrate(y0, at.xhat.data(), constrained.q.data());
  for (int i = 0; i < nv; ++i) constrained.v[i] = y0[nq + i] + at.xhat[nv + i];
  s_.manifold.integrate_partials(at.xhat.data(), constrained.v.data(), integrate_partials_hat_);
  s_.tree.poses(constrained.q.data());
  G_.assign(static_cast<size_t>(s_.ng) * nv, 0.0);
  s_.constraints.dense_value(s_.tree, constrained.q.data(), s_.constraints.all, G_);
  s_.closure_partials(constrained.q.data(), constrained.v.data(), nullptr, nullptr, &Bhat_, nullptr,
                      requested ? &constrained.wrench_partials : nullptr);
  time_.assign(s_.ng, 0.0);
  s_.constraints.evaluate_g_tt(at.that, time_.data());
  for (int k : s_.rows.in_use()) {
    const int i = s_.rows.position()[k];
    xhat.row(ny + i).head(nv) = RowsIn(&Bhat_[static_cast<size_t>(i) * nv], 1, nv);
    xhat.row(ny + i).tail(nv) = RowsIn(&G_[static_cast<size_t>(k) * nv], 1, nv);
    that[ny + i] = time_[k];
  }
  point_.constraint_points.push_back(std::move(constrained));
  if (forward_) {
    parameters_.rows(point_, Q_, point_.constraint_points[0].q);
    p.middleRows(ny, r_) = RowsIn(Q_.data(), p.cols(), r_).transpose();
  }
  if (!position_rows_) return;
  const LinearizationPoint::ConstraintPoint& here = point_.constraint_points[0];
  slip_.rows = position_rows_;
  slip_.constraint_points.push_back({at.that, here.q, here.v, LinearizationPoint::ConstraintPoint::g, 1});
  time_.assign(s_.ng, 0.0);
  s_.constraints.evaluate_g_t(at.that, time_.data());
  const int first = ny + r_ + nv;
  for (int k : position_rows_->in_use()) {
    const int i = first + position_rows_->position()[k];
    xhat.row(i).head(nv) = RowsIn(&G_[static_cast<size_t>(k) * nv], 1, nv);
    that[i] = time_[k];
  }
  if (!forward_) return;
  parameters_.rows(slip_, Q_, here.q);
  p.middleRows(first, k_) = RowsIn(Q_.data(), p.cols(), k_).transpose();
}

void StageEquations::motion(const double* y0, const StageValues& at) {
  const int nv = s_.nv, nq = s_.nq, ny = s_.ny;
  LinearizationPoint& o = point_;
  o.t = at.t, o.q.resize(nq), o.u.assign(n_, 0.0), o.vdot.assign(&at.F[nv], &at.F[2 * nv]), o.lam = at.lam;
  s_.manifold.integrate(y0, at.x.data(), o.q.data());
  for (int i = 0; i < nv + s_.ns; ++i) o.u[i] = y0[nq + i] + at.x[nv + i];
  Vector speed(o.u.begin(), o.u.begin() + nv);
  for (int i = 0; position_rows_ && i < nv; ++i) speed[i] += at.slip[i];
  s_.manifold.integrate_partials(at.x.data(), speed.data(), integrate_partials_);
  s_.force_partials(at.t, o.q.data(), o.u.data(), o.vdot.data(), o.lam.data(), at_, nullptr,
                    parameters_.frames_move() ? &o.wrenches : nullptr);
  std::fill(G_.begin(), G_.end(), 0.0);
  s_.constraints.dense_value(s_.tree, o.q.data(), s_.constraints.all, G_);
  by_unknowns.topLeftCorner(ny, ny).setIdentity();
  M_.resize(static_cast<size_t>(nv) * nv), s_.tree.dense_M(M_.data());
  by_unknowns.block(nv, nv, nv, nv) = RowsIn(M_.data(), nv, nv);
  x.block(0, nv, nv, nv) = -Rows<double>::Identity(nv, nv);
  x.block(nv, 0, n_, nv) = -RowsIn(at_.K.data(), n_, nv), x.block(nv, nv, n_, n_) = -RowsIn(at_.D.data(), n_, n_);
  for (int k : s_.rows.in_use()) {
    const int i = s_.rows.position()[k];
    by_unknowns.block(nv, ny + i, nv, 1) = -RowsIn(&G_[static_cast<size_t>(k) * nv], 1, nv).transpose();
    by_unknowns(ny - 1, ny + i) = at_.g_t[i];
  }
  if (s_.friction) friction();
  y.topRows(ny) = x.topRows(ny);
  Vector by_t(n_);
  s_.time_partials(at.t, o.q.data(), o.u.data(), o.lam.data(), by_t.data());
  t.segment(nv, n_) = -Eigen::Map<const Eigen::VectorXd>(by_t.data(), n_);
  if (!forward_) return;
  parameters_.forces(o, P_);
  p.middleRows(nv, n_) -= RowsIn(P_.data(), p.cols(), n_).transpose();
}

void StageEquations::friction() {
  const int nv = s_.nv, ny = s_.ny;
  const size_t n = n_;
  if (!parameters_.friction) throw FallBackToPython();
  s_.friction.update_slips(point_.u.data());
  s_.friction.partials(G_.data(), point_.lam.data(), at_.friction);
  for (int i = 0; i < r_; ++i) {
    const RowsIn of_lam(&at_.friction[static_cast<size_t>(i) * (nv + 1)], 1, nv + 1);
    by_unknowns.block(nv, ny + i, nv, 1) -= of_lam.leftCols(nv).transpose();
    by_unknowns(ny - 1, ny + i) -= of_lam(0, nv);
  }
  Vector K(n * nv), D(n * n);
  friction_columns_.resize(parameters_.count() * n);
  parameters_.friction(point_.q, Vector(point_.u.begin(), point_.u.begin() + nv), point_.lam, K, D, friction_columns_);
  x.block(nv, 0, n_, nv) -= RowsIn(K.data(), n_, nv), x.block(nv, nv, n_, n_) -= RowsIn(D.data(), n_, n_);
  if (forward_) p.middleRows(nv, n_) -= RowsIn(friction_columns_.data(), p.cols(), n_).transpose();
}

void StageEquations::positions(const StageValues& at) {
  const int nv = s_.nv, ny = s_.ny, first = ny + r_;
  const Vector zero(nv, 0.0);
  LinearizationPoint& o = slip_;
  o.loaded = false, o.t = at.t, o.q = point_.q, o.u.assign(n_, 0.0), o.vdot = at.slip, o.lam = at.mu;
  by_unknowns.block(first, first, nv, nv) = by_unknowns.block(nv, nv, nv, nv);
  for (int k : position_rows_->in_use()) {
    const RowsIn row(&G_[static_cast<size_t>(k) * nv], 1, nv);
    by_unknowns.block(first, first + nv + position_rows_->position()[k], nv, 1) = -row.transpose();
  }
  by_q_.assign(static_cast<size_t>(nv) * nv, 0.0), by_v_ = by_q_;
  Vector by_mu(by_q_);
  s_.closure_partials(o.q.data(), zero.data(), o.lam.data(), by_mu.data(), nullptr,
                      parameters_.frames_move() ? &o.wrenches : nullptr, nullptr, position_rows_);
  s_.tree.partials(o.q.data(), zero.data(), at.slip.data(), by_q_.data(), by_v_.data(), true);
  x.block(first, 0, nv, nv) = RowsIn(by_q_.data(), nv, nv) - RowsIn(by_mu.data(), nv, nv);
  y.block(first, 0, nv, nv) = x.block(first, 0, nv, nv);
  if (!forward_) return;
  parameters_.forces(o, P_);
  p.middleRows(first, nv) = -RowsIn(P_.data(), p.cols(), n_).leftCols(nv).transpose();
}

void StageEquations::add_parameters(const Eigen::MatrixXd& mu) {
  const int nv = s_.nv, ny = s_.ny;
  Vector above, below;
  const auto gather = [&](int at, int size, int rows, int last) {  // mu (m, costs): of equations, and of rows with the other sign
    above.clear(), below.clear();
    for (int c = 0; c < mu.cols(); ++c) {
      const double* column = mu.col(c).data();
      above.insert(above.end(), column + at, column + at + size), above.resize((c + 1) * n_, 0.0);
      for (int k = rows; k < last; ++k) below.push_back(-column[k]);
    }
  };
  gather(nv, ny - nv, ny, ny + r_);
  parameters_.add_point(point_, above, below);
  if (!friction_columns_.empty()) parameters_.add_columns(friction_columns_, above);
  if (!position_rows_) return;
  gather(ny + r_, nv, ny + r_ + nv, m_);
  parameters_.add_point(slip_, above, below);
}

}  // namespace mbdae
