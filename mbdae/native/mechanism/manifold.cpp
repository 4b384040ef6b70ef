// Exponential coordinates of SO(3), SE(3) and SE(2) joints: tangent map, its inverse and derivatives.
#include "mechanism/manifold.hpp"

#include <algorithm>
#include <cmath>

#include "mechanism/time_functions.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

void multiply(int n, const double* A, const double* x, double* out) {
  for (int i = 0; i < n; ++i) {
    double s = 0;
    for (int j = 0; j < n; ++j) s += A[i * n + j] * x[j];
    out[i] = s;
  }
}

// Write the adjoint matrix ad of p, (n, n) by rows; return n.
int ad(const GroupJoint& b, const double* p, double* X) {
  std::fill(X, X + 36, 0.0);
  auto skew = [&](const double* w, int row, int column, int width) {
    X[row * width + column + 1] = -w[2], X[row * width + column + 2] = w[1];
    X[(row + 1) * width + column] = w[2], X[(row + 1) * width + column + 2] = -w[0];
    X[(row + 2) * width + column] = -w[1], X[(row + 2) * width + column + 1] = w[0];
  };
  if (b.kind == GroupJoint::se3) {
    skew(p + 3, 0, 0, 6), skew(p, 0, 3, 6), skew(p + 3, 3, 3, 6);
    return 6;
  }
  if (b.kind == GroupJoint::so3)
    skew(p, 0, 0, 3);
  else
    X[1] = -p[2], X[2] = p[1], X[3] = p[2], X[5] = -p[0];
  return 3;
}

}  // namespace

void multiply_transposed(const std::vector<TangentBlock>& blocks, double* a, int stride) {
  for (const TangentBlock& b : blocks) {
    double out[6] = {};
    for (int i = 0; i < b.n; ++i)
      for (int k = 0; k < b.n; ++k) out[k] += b.J[i * b.n + k] * a[(b.start + i) * stride];
    for (int k = 0; k < b.n; ++k) a[(b.start + k) * stride] = out[k];
  }
}

void multiply_rows(const std::vector<TangentBlock>& blocks, Vector& X, int n) {
  if (blocks.empty()) return;
  for (size_t row = 0; row < X.size(); row += n) multiply_transposed(blocks, &X[row]);
}

// y = x + sum (-1)^k/(k + 1)! X^k x: the right Jacobian of exp.
static void right_jacobian(const Tolerances& tolerances, int n, const double* X, const double* x, double* y) {
  double term[6], next[6];
  std::copy(x, x + n, term), std::copy(x, x + n, y);
  const double size = largest(x, n);
  for (size_t k = 1; k < 2 * tolerances.series.size(); ++k) {
    multiply(n, X, term, next);
    for (int i = 0; i < n; ++i) term[i] = -next[i] / (k + 1), y[i] += term[i];
    if (largest(term, n) <= tolerances.below_rounding * size) break;
  }
}

// y = J x, J = 1 + X/2 + sum B_2k/(2k)! X^2k with X = ad (n, n) by rows: the inverse right Jacobian of exp.
static void inverse_jacobian(const Tolerances& tolerances, int n, const double* X, const double* x, double* y) {
  double term[6], next[6];
  multiply(n, X, x, next);
  for (int i = 0; i < n; ++i) y[i] = x[i] + 0.5 * next[i], term[i] = x[i];
  const double size = largest(x, n);
  for (double b : tolerances.series) {
    multiply(n, X, term, next), multiply(n, X, next, term);
    for (int i = 0; i < n; ++i) y[i] += b * term[i];
    if (largest(term, n) * std::fabs(b) <= tolerances.below_rounding * size) break;
  }
}

// out = d/ds J(x + s e) v, with X = ad_x and dX = ad_e (n, n) by rows.
static void inverse_jacobian_rate(const Tolerances& tolerances, int n, const double* X, const double* dX,
                                  const double* v, double* out) {
  double term[6], dterm[6] = {0, 0, 0, 0, 0, 0}, next[6], dnext[6], work[6];
  multiply(n, dX, v, out);
  for (int i = 0; i < n; ++i) out[i] *= 0.5, term[i] = v[i];
  const double size = largest(v, n);
  for (double b : tolerances.series) {
    multiply(n, X, term, next), multiply(n, dX, term, dnext), multiply(n, X, dterm, work);
    for (int i = 0; i < n; ++i) dnext[i] += work[i];
    multiply(n, X, next, term), multiply(n, dX, next, dterm), multiply(n, X, dnext, work);
    for (int i = 0; i < n; ++i) dterm[i] += work[i], out[i] += b * dterm[i];
    if (std::max(largest(term, n), largest(dterm, n)) * std::fabs(b) <= tolerances.below_rounding * size) break;
  }
}

Manifold::Manifold(MultibodyTree& m, bool flat_, std::vector<GroupJoint> group_joints, std::vector<int> angular)
    : flat(flat_),
      m_(m),
      group_joints_(std::move(group_joints)),
      angular_(std::move(angular)),
      neutral_(m.nq) {
  m.neutral(neutral_.data());
}

void Manifold::integrate(const double* q, const double* x, double* out) const {
  for (int i = 0; flat && i < m_.nq; ++i) out[i] = q[i] + x[i];
  if (!flat) m_.integrate(q, x, out);  // out may be q
}

void Manifold::difference(const double* q0, const double* q1, double* out) const {
  for (int i = 0; flat && i < m_.nv; ++i) out[i] = q1[i] - q0[i];
  if (!flat) m_.difference(q0, q1, out);
}

void Manifold::component_magnitudes(const double* q, double* out) const {
  if (!flat) difference(neutral_.data(), q, out);
  for (int i = 0; i < m_.nv; ++i) out[i] = flat ? std::fabs(q[i]) : angular_[i] ? 1.0 : std::fabs(out[i]);
}

double Manifold::largest_rotation(const double* x) const {
  double out = 0;
  for (const GroupJoint& b : group_joints_) {
    const double *u = x + b.iv, *rotation = b.kind == GroupJoint::se3 ? u + 3 : u;
    out = std::max(out, b.kind == GroupJoint::se2 ? std::fabs(u[2]) : norm(rotation, 3));
  }
  return out;
}

void Manifold::check_rotations(const double* x) const {
  if (largest_rotation(x) > m_.tolerances.max_rotation) throw StepTooLong();
}

void Manifold::tangent(const double* x, double* dx) const {
  if (group_joints_.empty()) return;
  check_rotations(x);
  for (const GroupJoint& b : group_joints_) {
    double X[36], out[6];
    const int n = ad(b, x + b.iv, X);
    inverse_jacobian(m_.tolerances, n, X, dx + b.iv, out);
    std::copy(out, out + n, dx + b.iv);
  }
}

void Manifold::velocity(const double* x, double* v) const {
  for (const GroupJoint& b : group_joints_) {
    double X[36], out[6];
    const int n = ad(b, x + b.iv, X);
    right_jacobian(m_.tolerances, n, X, v + b.iv, out);
    std::copy(out, out + n, v + b.iv);
  }
}

void Manifold::transfer(const double* x, const double* to, std::vector<TangentBlock>& out) const {
  out.resize(group_joints_.size());
  for (size_t i = 0; i < group_joints_.size(); ++i) {
    const GroupJoint& b = group_joints_[i];
    TangentBlock& t = out[i];
    double from[36], X[36], mapped[6], column[6];
    t.start = b.iv, t.n = ad(b, x + b.iv, from);
    ad(b, to + b.iv, X);
    for (int k = 0; k < t.n; ++k) {
      double e[6] = {0, 0, 0, 0, 0, 0};
      e[k] = 1;
      inverse_jacobian(m_.tolerances, t.n, from, e, mapped);
      right_jacobian(m_.tolerances, t.n, X, mapped, column);
      for (int j = 0; j < t.n; ++j) t.J[j * t.n + k] = column[j];
    }
  }
}

void Manifold::partials(const double* x, const double* v, std::vector<TangentBlock>& out) const {
  out.resize(group_joints_.size());
  for (size_t i = 0; i < group_joints_.size(); ++i) {
    const GroupJoint& b = group_joints_[i];
    TangentBlock& t = out[i];
    double X[36], dX[36], column[6];
    t.start = b.iv, t.n = ad(b, x + b.iv, X);
    for (int k = 0; k < t.n; ++k) {
      double e[6] = {0, 0, 0, 0, 0, 0};
      e[k] = 1;
      inverse_jacobian(m_.tolerances, t.n, X, e, column);
      for (int j = 0; j < t.n; ++j) t.J[j * t.n + k] = column[j];
      ad(b, e, dX);
      inverse_jacobian_rate(m_.tolerances, t.n, X, dX, v + b.iv, column);
      for (int j = 0; j < t.n; ++j) t.dJv[j * t.n + k] = column[j];
    }
  }
}

void Manifold::integrate_partials(const double* x, const double* v, std::vector<IntegratePartialsBlock>& out) const {
  std::vector<TangentBlock> tangents;
  partials(x, v, tangents);
  out.resize(group_joints_.size());
  for (size_t i = 0; i < group_joints_.size(); ++i) {
    IntegratePartialsBlock& t = out[i];
    const int n = t.n = tangents[i].n, start = t.start = tangents[i].start;
    double X[36], column[6], X_column[6];
    std::copy_n(tangents[i].J, n * n, t.J), std::copy_n(tangents[i].dJv, n * n, t.T);
    ad(group_joints_[i], x + start, X);
    for (int k = 0; k < n; ++k) {
      double e[6] = {0, 0, 0, 0, 0, 0};
      e[k] = 1;
      right_jacobian(m_.tolerances, n, X, e, column), multiply(n, X, column, X_column);
      for (int j = 0; j < n; ++j) t.R[j * n + k] = column[j], t.A[j * n + k] = (j == k) - X_column[j];
    }
  }
}

}  // namespace mbdae
