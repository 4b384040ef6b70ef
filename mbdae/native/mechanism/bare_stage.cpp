// The calls of Pinocchio that a stage requires at least.
#include <chrono>

#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "math/dense_lu.hpp"
#include "mechanism/mechanics_workspace.hpp"

namespace mbdae {

double Mechanics::bare(const double* q, const double* v, int r, const double* G_, int repetitions) {
  using Matrix = Eigen::MatrixXd;
  const Matrix GT = Eigen::Map<const Matrix>(G_, nv, r);
  w->q = In(q, nq), w->v = In(v, nv);
  pinocchio::Data data(w->model);
  Matrix X(nv, r + 1);
  DenseLU<1> S;
  VectorXd lam(r), vdot(nv);
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < repetitions; ++i) {
    pinocchio::crba(w->model, data, Vector(w->q), pinocchio::Convention::WORLD);
    pinocchio::cholesky::decompose(w->model, data);
    X.leftCols(r) = GT;
    X.col(r) = -pinocchio::nonLinearEffects(w->model, data, Vector(w->q), Vector(w->v));
    pinocchio::cholesky::solve(w->model, data, X);
    vdot = X.col(r);
    if (r) {
      S.resize(r);
      Eigen::Map<Matrix>(S.column(0), r, r).noalias() = GT.transpose() * X.leftCols(r);
      lam.noalias() = -GT.transpose() * vdot;
      if (S.factorize()) S.solve(lam.data());
      vdot.noalias() += X.leftCols(r) * lam;
    }
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / repetitions;
}

}  // namespace mbdae
