#include "sensitivity/coupled_stages.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

constexpr int halvings = 6;  // of the step, to obtain a guess

}  // namespace

StepCoefficients::StepCoefficients(const Tableau& a)
    : n(a.n), first(a.explicit_first), A(a.A), Ahat(a.Ahat), b(a.b), c(a.c), chat(a.chat) {}

StepCoefficients::StepCoefficients(const Radau& a)
    : n(a.s), coupled(true), A(a.A), Ahat(a.A), b(a.A.end() - a.s, a.A.end()), c(a.c), chat(a.c) {}

void CoupledStages::System::factorize(Matrix a) {
  A = std::move(a);
  const int n = static_cast<int>(A.rows());
  lu.resize(n);
  for (int j = 0; j < n; ++j) std::copy_n(A.data() + j * n, n, lu.column(j));
  if (!lu.factorize()) throw FallBackToPython();
}

CoupledStages::Matrix CoupledStages::System::solve(const Matrix& b) const {
  const int n = lu.size();
  Matrix x = b;
  Eigen::VectorXd left(n);
  for (int j = 0; j < b.cols(); ++j) {
    lu.solve(x.col(j).data());
    left = b.col(j);
    int k = 0;
    for (; k + 4 <= n; k += 4)
      left -= x(k, j) * A.col(k) + x(k + 1, j) * A.col(k + 1) + x(k + 2, j) * A.col(k + 2) + x(k + 3, j) * A.col(k + 3);
    for (; k < n; ++k) left -= x(k, j) * A.col(k);
    lu.solve(left.data());
    x.col(j) += left;
  }
  return x;
}

CoupledStages::Matrix CoupledStages::System::solve_transposed(const Matrix& b) const {
  const int n = lu.size();
  Matrix x = b;
  Eigen::VectorXd left(n);
  for (int j = 0; j < b.cols(); ++j) {
    lu.solve_transposed(x.col(j).data());
    for (int k = 0; k < n; ++k) left[k] = b(k, j) - A.col(k).dot(x.col(j));
    lu.solve_transposed(left.data());
    x.col(j) += left;
  }
  return x;
}

CoupledStages::CoupledStages(Index2System& s, ParameterPartials& parameters, bool forward, StepCoefficients a,
                             std::unique_ptr<StageRecorder> steps)
    : s_(s), parameters_(parameters), forward_(forward), a_(std::move(a)), steps_(std::move(steps)) {
  for (int i = a_.first; i < a_.n; ++i) stages_.emplace_back(new StageEquations(s, parameters, forward));
  systems_.resize(a_.coupled ? 1 : stages_.size());
}

void CoupledStages::couple(Rows<double>& to, int i, int j) const {
  const int nv = s_.nv;
  const StageEquations& e = *stages_[i - a_.first];
  const double a = h_ * a_.A[i * a_.n + j], ahat = h_ * a_.Ahat[i * a_.n + j];
  to.leftCols(s_.ny) += a * e.x;
  to.leftCols(2 * nv) += ahat * e.xhat;
}

void CoupledStages::repeat(double t, double h, const State& in, State& out) {
  h_ = h, r_ = static_cast<int>(s_.rows.in_use().size());
  try {
    steps_->take(t, h, in, out);
  } catch (const StepTooLong&) {
    newton(t, h, in, halvings);
    steps_->finish(in, out);
  }
  linearize(in.y);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(s_.ny);
  for (int i = 0; i < a_.n; ++i) x += h * a_.b[i] * steps_->F.row(i).transpose();
  s_.manifold.integrate_partials(x.data(), x.data(), end_);
}

void CoupledStages::newton(double t, double h, const State& in, int left) {
  for (bool again : {false, true}) {
    if (again) {
      if (!left) break;
      newton(t, h / 2, in, left - 1), steps_->extend(h);
    } else {
      steps_->guess(t, h, in);
    }
    h_ = h;
    for (int k = 0; k < s_.tree.limits.stage_iterations; ++k) {
      linearize(in.y);
      const int n = a_.n, m = stages_[0]->size();
      Eigen::VectorXd right(n * m);
      for (int i = 0; i < n; ++i) right.segment(i * m, m) = steps_->negative_residual(i);
      const Matrix change = systems_[0].solve(right);
      if (!change.allFinite()) break;
      const Rows<double> moves = RowsIn(change.data(), n, m);
      const double size = std::fabs(h) * moves.leftCols(s_.ny - 1).cwiseAbs().maxCoeff();
      steps_->correct(moves);
      if (size <= s_.tree.limits.solution_rounding *
                      (1 + std::fabs(h) * steps_->F.leftCols(s_.ny - 1).cwiseAbs().maxCoeff()))
        return;
    }
  }
  throw StepTooLong();
}

void CoupledStages::linearize(const Vector& y) {
  const int n = static_cast<int>(stages_.size());
  for (int i = 0; i < n; ++i) stages_[i]->take(y.data(), steps_->stages[i], steps_->positions);
  if (a_.coupled) {
    const int m = n ? stages_[0]->size() : 0;
    Matrix all = Matrix::Zero(n * m, n * m);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        Rows<double> one = Rows<double>::Zero(m, m);
        if (i == j) one = stages_[i]->by_unknowns;
        couple(one, i, j);
        all.block(i * m, j * m, m, m) = one;
      }
    systems_[0].factorize(std::move(all));
  } else {
    for (int i = 0; i < n; ++i) {
      Rows<double> one = stages_[i]->by_unknowns;
      couple(one, i + a_.first, i + a_.first);
      systems_[i].factorize(one);
    }
  }
}

void CoupledStages::forward(int directions, double* moved, const double* dp, const double* dh, const double* dt) {
  const int n = a_.n, ny = s_.ny, nv = s_.nv, first = a_.first, lead = slip() < 0 ? 0 : nv, tail = ny - nv;
  const int width = ny + (first ? lead + tail : 0), k = forward_ ? static_cast<int>(parameters_.count()) : 0;
  const int m = stages_.empty() ? 0 : stages_[0]->size();
  Eigen::Map<Matrix> all(moved, width, directions);
  const Eigen::Map<const Matrix> p(dp, k, k ? directions : 0);
  const Matrix dy = all.topRows(ny);
  Eigen::VectorXd rate = Eigen::VectorXd::Zero(directions);
  if (dh) rate = Eigen::Map<const Eigen::VectorXd>(dh, directions);
  std::vector<Matrix> dF(n, Matrix::Zero(ny, directions));
  Matrix carried = Matrix::Zero(lead, directions);
  if (first) {
    dF[0].topRows(nv) = dy.middleRows(nv, nv), dF[0].bottomRows(tail) = all.bottomRows(tail);
    if (lead) dF[0].topRows(nv) += all.middleRows(ny, nv);
  }
  Matrix right(a_.coupled ? m * (n - first) : 0, directions);
  for (int i = first; i < n; ++i) {
    const StageEquations& e = *stages_[i - first];
    Matrix b = -(e.y.lazyProduct(dy));
    if (k) b -= e.p.lazyProduct(p);
    Matrix dx = Matrix::Zero(ny, directions), dxhat = dx;
    for (int j = 0; j < n; ++j) {
      const double a = a_.A[i * n + j], ahat = a_.Ahat[i * n + j];
      if (!a_.coupled && j < i) dx += h_ * a * dF[j], dxhat += h_ * ahat * dF[j];
      if (dh) dx += a * steps_->F.row(j).transpose() * rate.transpose();
      if (dh) dxhat += ahat * steps_->F.row(j).transpose() * rate.transpose();
    }
    b -= e.x.lazyProduct(dx) + e.xhat.lazyProduct(dxhat.topRows(2 * nv));
    if (dh) b -= (a_.c[i] * e.t + a_.chat[i] * e.that) * rate.transpose();
    if (dt) b -= (e.t + e.that) * Eigen::Map<const Eigen::VectorXd>(dt, directions).transpose();
    if (a_.coupled) {
      right.middleRows((i - first) * m, m) = b;
      continue;
    }
    b = systems_[i - first].solve(b);
    dF[i] = b.topRows(ny);
    if (lead) carried = b.middleRows(slip(), nv);
  }
  if (a_.coupled) {
    right = systems_[0].solve(right);
    for (int i = 0; i < n; ++i) dF[i] = right.middleRows(i * m, ny);
  }
  Matrix dx = Matrix::Zero(ny, directions);
  for (int i = 0; i < n; ++i) {
    dx += h_ * a_.b[i] * dF[i];
    if (dh) dx += a_.b[i] * steps_->F.row(i).transpose() * rate.transpose();
  }
  all.topRows(ny) = dy + dx;
  for (const IntegratePartialsBlock& b : end_)
    all.middleRows(b.at, b.n) = RowsIn(b.A, b.n, b.n).lazyProduct(dy.middleRows(b.at, b.n)) + RowsIn(b.R, b.n, b.n).lazyProduct(dx.middleRows(b.at, b.n));
  if (!first) return;
  if (lead) all.middleRows(ny, nv) = carried;
  all.bottomRows(tail) = dF[n - 1].bottomRows(tail);
}

void CoupledStages::reverse(int costs, double* bars) {
  const int n = a_.n, ny = s_.ny, nv = s_.nv, first = a_.first, lead = slip() < 0 ? 0 : nv, tail = ny - nv;
  const int width = ny + (first ? lead + tail : 0), m = stages_.empty() ? 0 : stages_[0]->size();
  Eigen::Map<Matrix> all(bars, width, costs);
  Matrix out = all.topRows(ny), x = out;
  for (const IntegratePartialsBlock& b : end_) {
    out.middleRows(b.at, b.n) = RowsIn(b.A, b.n, b.n).transpose().lazyProduct(all.middleRows(b.at, b.n));
    x.middleRows(b.at, b.n) = RowsIn(b.R, b.n, b.n).transpose().lazyProduct(all.middleRows(b.at, b.n));
  }
  std::vector<Matrix> F(n);
  for (int i = 0; i < n; ++i) F[i] = h_ * a_.b[i] * x;
  if (first) F[n - 1].bottomRows(tail) += all.bottomRows(tail);
  const Matrix carried = all.middleRows(first ? ny : 0, first ? lead : 0);
  const auto back = [&](int i, const Matrix& mu) {  // of the equations of a stage, to what they depend on
    const StageEquations& e = *stages_[i - first];
    out -= e.y.transpose().lazyProduct(mu);
    stages_[i - first]->add_parameters(mu);
    if (a_.coupled) return;
    const Matrix X = e.x.transpose().lazyProduct(mu), Xhat = e.xhat.transpose().lazyProduct(mu);
    for (int j = 0; j < i; ++j)
      F[j] -= h_ * a_.A[i * n + j] * X, F[j].topRows(2 * nv) -= h_ * a_.Ahat[i * n + j] * Xhat;
  };
  if (a_.coupled) {
    Matrix right = Matrix::Zero(n * m, costs);
    for (int i = 0; i < n; ++i) right.middleRows(i * m, ny) = F[i];
    const Matrix mu = systems_[0].solve_transposed(right);
    for (int i = 0; i < n; ++i) back(i, mu.middleRows(i * m, m));
  }
  for (int i = n - 1; !a_.coupled && i >= first; --i) {
    Matrix right = Matrix::Zero(m, costs);
    right.topRows(ny) = F[i];
    if (i == n - 1 && first && lead) right.middleRows(slip(), nv) = carried;
    back(i, systems_[i - first].solve_transposed(right));
  }
  if (first) {
    out.middleRows(nv, nv) += F[0].topRows(nv);
    if (lead) all.middleRows(ny, nv) = F[0].topRows(nv);
    all.bottomRows(tail) = F[0].bottomRows(tail);
  }
  all.topRows(ny) = out;
}

}  // namespace mbdae
