// Linear systems of the stages of a step, and their tangent and adjoint solutions.
#include "sensitivity/general_step_sensitivity.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

constexpr int max_halvings = 6;  // largest number of halvings of the step, to obtain an initial guess

}  // namespace

StepCoefficients::StepCoefficients(const Tableau& a)
    : n(a.n), first(a.explicit_first), A(a.A), Ahat(a.Ahat), b(a.b), c(a.c), chat(a.chat) {}

StepCoefficients::StepCoefficients(const Radau& a)
    : n(a.s), fully_implicit(true), A(a.A), Ahat(a.A), b(a.A.end() - a.s, a.A.end()), c(a.c), chat(a.c) {}

void GeneralStepSensitivity::System::factorize(Matrix a) {
  A = std::move(a);
  const int n = static_cast<int>(A.rows());
  lu.resize(n);
  for (int j = 0; j < n; ++j) std::copy_n(A.data() + j * n, n, lu.column(j));
  if (!lu.factorize()) throw FallBackToPython();
}

GeneralStepSensitivity::Matrix GeneralStepSensitivity::System::solve(const Matrix& b) const {
  const int n = lu.size();
  Matrix x = b;
  Eigen::VectorXd residual(n);
  for (int j = 0; j < b.cols(); ++j) {
    lu.solve(x.col(j).data());
    residual = b.col(j);
    int k = 0;
    for (; k + 4 <= n; k += 4)
      residual -=
          x(k, j) * A.col(k) + x(k + 1, j) * A.col(k + 1) + x(k + 2, j) * A.col(k + 2) + x(k + 3, j) * A.col(k + 3);
    for (; k < n; ++k) residual -= x(k, j) * A.col(k);
    lu.solve(residual.data());
    x.col(j) += residual;
  }
  return x;
}

GeneralStepSensitivity::Matrix GeneralStepSensitivity::System::solve_transposed(const Matrix& b) const {
  const int n = lu.size();
  Matrix x = b;
  Eigen::VectorXd residual(n);
  for (int j = 0; j < b.cols(); ++j) {
    lu.solve_transposed(x.col(j).data());
    for (int k = 0; k < n; ++k) residual[k] = b(k, j) - A.col(k).dot(x.col(j));
    lu.solve_transposed(residual.data());
    x.col(j) += residual;
  }
  return x;
}

GeneralStepSensitivity::GeneralStepSensitivity(Index2System& s, ParameterPartials& parameters, bool forward, StepCoefficients a,
                             std::unique_ptr<StageRecorder> steps)
    : s_(s), parameters_(parameters), forward_(forward), a_(std::move(a)), steps_(std::move(steps)) {
  for (int i = a_.first; i < a_.n; ++i) stages_.emplace_back(new StageEquations(s, parameters, forward));
  systems_.resize(a_.fully_implicit ? 1 : stages_.size());
}

void GeneralStepSensitivity::add_stage_partials(Rows<double>& matrix, int i, int j) const {
  const int nv = s_.nv;
  const StageEquations& e = *stages_[i - a_.first];
  const double a = h_ * a_.A[i * a_.n + j], ahat = h_ * a_.Ahat[i * a_.n + j];
  matrix.leftCols(s_.ny) += a * e.x;
  matrix.leftCols(2 * nv) += ahat * e.xhat;
}

void GeneralStepSensitivity::repeat(double t, double h, const State& in, State& out) {
  h_ = h, r_ = static_cast<int>(s_.rows.in_use().size());
  try {
    steps_->take(t, h, in, out);
  } catch (const StepTooLong&) {
    newton(t, h, in, max_halvings);
    steps_->finish(in, out);
  }
  linearize(in.y);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(s_.ny);
  for (int i = 0; i < a_.n; ++i) x += h * a_.b[i] * steps_->F.row(i).transpose();
  s_.manifold.integrate_partials(x.data(), x.data(), end_);
}

void GeneralStepSensitivity::newton(double t, double h, const State& in, int halvings_left) {
  for (bool from_half_step : {false, true}) {
    if (from_half_step) {
      if (!halvings_left) break;
      newton(t, h / 2, in, halvings_left - 1), steps_->extend(h);
    } else {
      steps_->initial_guess(t, h, in);
    }
    h_ = h;
    for (int k = 0; k < s_.tree.tolerances.stage_iterations; ++k) {
      linearize(in.y);
      const int n = a_.n, m = stages_[0]->size();
      Eigen::VectorXd rhs(n * m);
      for (int i = 0; i < n; ++i) rhs.segment(i * m, m) = steps_->negative_residual(i);
      const Matrix change = systems_[0].solve(rhs);
      if (!change.allFinite()) break;
      const Rows<double> corrections = ConstMatrixMap(change.data(), n, m);
      const double size = std::fabs(h) * corrections.leftCols(s_.ny - 1).cwiseAbs().maxCoeff();
      steps_->correct(corrections);
      if (size <= s_.tree.tolerances.solution_rounding *
                      (1 + std::fabs(h) * steps_->F.leftCols(s_.ny - 1).cwiseAbs().maxCoeff()))
        return;
    }
  }
  throw StepTooLong();
}

void GeneralStepSensitivity::linearize(const Vector& y) {
  const int n = static_cast<int>(stages_.size());
  for (int i = 0; i < n; ++i) stages_[i]->take(y.data(), steps_->stages[i], steps_->positions);
  if (a_.fully_implicit) {
    const int m = n ? stages_[0]->size() : 0;
    Matrix matrix = Matrix::Zero(n * m, n * m);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        Rows<double> block = Rows<double>::Zero(m, m);
        if (i == j) block = stages_[i]->unknown_partials;
        add_stage_partials(block, i, j);
        matrix.block(i * m, j * m, m, m) = block;
      }
    systems_[0].factorize(std::move(matrix));
  } else {
    for (int i = 0; i < n; ++i) {
      Rows<double> block = stages_[i]->unknown_partials;
      add_stage_partials(block, i + a_.first, i + a_.first);
      systems_[i].factorize(block);
    }
  }
}

void GeneralStepSensitivity::forward(int directions, double* tangents, const double* dp, const double* dh, const double* dt) {
  const int n = a_.n, ny = s_.ny, nv = s_.nv, first = a_.first, mu_size = mu_velocity_start() < 0 ? 0 : nv,
            carry_size = ny - nv;
  const int width = ny + (first ? mu_size + carry_size : 0), k = forward_ ? static_cast<int>(parameters_.count()) : 0;
  const int m = stages_.empty() ? 0 : stages_[0]->size();
  Eigen::Map<Matrix> tangent_matrix(tangents, width, directions);
  const Eigen::Map<const Matrix> p(dp, k, k ? directions : 0);
  const Matrix dy = tangent_matrix.topRows(ny);
  Eigen::VectorXd step_tangent = Eigen::VectorXd::Zero(directions);
  if (dh) step_tangent = Eigen::Map<const Eigen::VectorXd>(dh, directions);
  std::vector<Matrix> dF(n, Matrix::Zero(ny, directions));
  Matrix mu_velocity = Matrix::Zero(mu_size, directions);
  if (first) {
    dF[0].topRows(nv) = dy.middleRows(nv, nv), dF[0].bottomRows(carry_size) = tangent_matrix.bottomRows(carry_size);
    if (mu_size) dF[0].topRows(nv) += tangent_matrix.middleRows(ny, nv);
  }
  Matrix rhs(a_.fully_implicit ? m * (n - first) : 0, directions);
  for (int i = first; i < n; ++i) {
    const StageEquations& e = *stages_[i - first];
    Matrix b = -(e.y.lazyProduct(dy));
    if (k) b -= e.p.lazyProduct(p);
    Matrix dx = Matrix::Zero(ny, directions), dxhat = dx;
    for (int j = 0; j < n; ++j) {
      const double a = a_.A[i * n + j], ahat = a_.Ahat[i * n + j];
      if (!a_.fully_implicit && j < i) dx += h_ * a * dF[j], dxhat += h_ * ahat * dF[j];
      if (dh) dx += a * steps_->F.row(j).transpose() * step_tangent.transpose();
      if (dh) dxhat += ahat * steps_->F.row(j).transpose() * step_tangent.transpose();
    }
    b -= e.x.lazyProduct(dx) + e.xhat.lazyProduct(dxhat.topRows(2 * nv));
    if (dh) b -= (a_.c[i] * e.t + a_.chat[i] * e.t_hat) * step_tangent.transpose();
    if (dt) b -= (e.t + e.t_hat) * Eigen::Map<const Eigen::VectorXd>(dt, directions).transpose();
    if (a_.fully_implicit) {
      rhs.middleRows((i - first) * m, m) = b;
      continue;
    }
    b = systems_[i - first].solve(b);
    dF[i] = b.topRows(ny);
    if (mu_size) mu_velocity = b.middleRows(mu_velocity_start(), nv);
  }
  if (a_.fully_implicit) {
    rhs = systems_[0].solve(rhs);
    for (int i = 0; i < n; ++i) dF[i] = rhs.middleRows(i * m, ny);
  }
  Matrix dx = Matrix::Zero(ny, directions);
  for (int i = 0; i < n; ++i) {
    dx += h_ * a_.b[i] * dF[i];
    if (dh) dx += a_.b[i] * steps_->F.row(i).transpose() * step_tangent.transpose();
  }
  tangent_matrix.topRows(ny) = dy + dx;
  for (const IntegratePartialsBlock& b : end_)
    tangent_matrix.middleRows(b.start, b.n) = ConstMatrixMap(b.A, b.n, b.n).lazyProduct(dy.middleRows(b.start, b.n)) +
                                              ConstMatrixMap(b.R, b.n, b.n).lazyProduct(dx.middleRows(b.start, b.n));
  if (!first) return;
  if (mu_size) tangent_matrix.middleRows(ny, nv) = mu_velocity;
  tangent_matrix.bottomRows(carry_size) = dF[n - 1].bottomRows(carry_size);
}

void GeneralStepSensitivity::reverse(int costs, double* cotangents) {
  const int n = a_.n, ny = s_.ny, nv = s_.nv, first = a_.first, mu_size = mu_velocity_start() < 0 ? 0 : nv,
            carry_size = ny - nv;
  const int width = ny + (first ? mu_size + carry_size : 0), m = stages_.empty() ? 0 : stages_[0]->size();
  Eigen::Map<Matrix> cotangent_matrix(cotangents, width, costs);
  Matrix out = cotangent_matrix.topRows(ny), x = out;
  for (const IntegratePartialsBlock& b : end_) {
    out.middleRows(b.start, b.n) =
        ConstMatrixMap(b.A, b.n, b.n).transpose().lazyProduct(cotangent_matrix.middleRows(b.start, b.n));
    x.middleRows(b.start, b.n) =
        ConstMatrixMap(b.R, b.n, b.n).transpose().lazyProduct(cotangent_matrix.middleRows(b.start, b.n));
  }
  std::vector<Matrix> F(n);
  for (int i = 0; i < n; ++i) F[i] = h_ * a_.b[i] * x;
  if (first) F[n - 1].bottomRows(carry_size) += cotangent_matrix.bottomRows(carry_size);
  const Matrix mu_velocity = cotangent_matrix.middleRows(first ? ny : 0, first ? mu_size : 0);
  // add the cotangents that a stage contributes, from the adjoint variables of its equations
  const auto add_cotangents = [&](int i, const Matrix& adjoint) {
    const StageEquations& e = *stages_[i - first];
    out -= e.y.transpose().lazyProduct(adjoint);
    stages_[i - first]->add_parameters(adjoint);
    if (a_.fully_implicit) return;
    const Matrix X = e.x.transpose().lazyProduct(adjoint), Xhat = e.xhat.transpose().lazyProduct(adjoint);
    for (int j = 0; j < i; ++j)
      F[j] -= h_ * a_.A[i * n + j] * X, F[j].topRows(2 * nv) -= h_ * a_.Ahat[i * n + j] * Xhat;
  };
  if (a_.fully_implicit) {
    Matrix rhs = Matrix::Zero(n * m, costs);
    for (int i = 0; i < n; ++i) rhs.middleRows(i * m, ny) = F[i];
    const Matrix adjoint = systems_[0].solve_transposed(rhs);
    for (int i = 0; i < n; ++i) add_cotangents(i, adjoint.middleRows(i * m, m));
  }
  for (int i = n - 1; !a_.fully_implicit && i >= first; --i) {
    Matrix rhs = Matrix::Zero(m, costs);
    rhs.topRows(ny) = F[i];
    if (i == n - 1 && first && mu_size) rhs.middleRows(mu_velocity_start(), nv) = mu_velocity;
    add_cotangents(i, systems_[i - first].solve_transposed(rhs));
  }
  if (first) {
    out.middleRows(nv, nv) += F[0].topRows(nv);
    if (mu_size) cotangent_matrix.middleRows(ny, nv) = F[0].topRows(nv);
    cotangent_matrix.bottomRows(carry_size) = F[0].bottomRows(carry_size);
  }
  cotangent_matrix.topRows(ny) = out;
}

}  // namespace mbdae
