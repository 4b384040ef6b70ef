// Benchmark: the minimal Pinocchio calls of one stage.
#include <chrono>

#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "math/dense_lu.hpp"
#include "mechanism/model.hpp"

namespace mbdae {

double pinocchio_stage_seconds(const void* pointer, const double* q_, const double* v_, int r, const double* G_,
                               int repetitions) {
  using Matrix = Eigen::MatrixXd;
  using VectorXd = Eigen::VectorXd;
  using VectorRef = Eigen::Ref<const VectorXd>;
  const auto& model = *static_cast<const pinocchio::Model*>(pointer);
  const int nv = model.nv;
  const Matrix GT = Eigen::Map<const Matrix>(G_, nv, r);
  const VectorXd q = Eigen::Map<const VectorXd>(q_, model.nq), v = Eigen::Map<const VectorXd>(v_, nv);
  pinocchio::Data data(model);
  Matrix X(nv, r + 1);
  DenseLU<1> S;
  VectorXd lam(r), vdot(nv);
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < repetitions; ++i) {
    pinocchio::crba(model, data, VectorRef(q), pinocchio::Convention::WORLD);
    pinocchio::cholesky::decompose(model, data);
    X.leftCols(r) = GT;
    X.col(r) = -pinocchio::nonLinearEffects(model, data, VectorRef(q), VectorRef(v));
    pinocchio::cholesky::solve(model, data, X);
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
