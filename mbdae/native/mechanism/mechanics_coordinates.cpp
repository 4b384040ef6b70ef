// Coordinates of Pinocchio's model.
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "mechanism/mechanics_workspace.hpp"

namespace mbdae {

void Mechanics::integrate(const double* q, const double* x, double* out) {
  w->q = In(q, nq), w->v = In(x, nv);
  pinocchio::integrate(w->model, w->q, w->v, w->end);
  Out(out, nq) = w->end;
}

void Mechanics::difference(const double* q0, const double* q1, double* out) {
  Out(out, nv) = pinocchio::difference(w->model, VectorXd(In(q0, nq)), VectorXd(In(q1, nq)));
}

void Mechanics::normalize(double* q) {
  w->q = In(q, nq);
  pinocchio::normalize(w->model, w->q);
  Out(q, nq) = w->q;
}

void Mechanics::tangent_map(const double* q, const double* v, double* dq) {
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(nq, nv);
  w->q = In(q, nq);
  pinocchio::tangentMap(w->model, w->q, T, pinocchio::SETTO);
  Out(dq, nq).noalias() = T * In(v, nv);
}

void Mechanics::neutral(double* q) { Out(q, nq) = pinocchio::neutral(w->model); }

}  // namespace mbdae
