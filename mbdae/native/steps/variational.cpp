// The discrete Euler-Lagrange equations of a RATTLE step, and their Newton matrix.
#include "steps/variational.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// out = A x, (n, n) by rows.
void multiply(const Vector& A, const double* x, int n, double* out) {
  for (int i = 0; i < n; ++i) out[i] = dot(&A[static_cast<size_t>(i) * n], x, n);
}

}  // namespace

VariationalStep::VariationalStep(Index2System& s)
    : s_(s),
      nq_(s.nq),
      nv_(s.nv),
      q1_(s.nq),
      w_(s.nv),
      zero_(s.nv, 0.0),
      g_(s.ng),
      mean_(s.nv),
      p_(s.nv) {}

void VariationalStep::momentum_partials(const double* q, EndpointTerms& out) {
  const size_t n = static_cast<size_t>(nv_) * nv_;
  out.N.resize(n), dtau_dv_.resize(n);
  s_.counts.M += 1;
  s_.tree.inertia(q, zero_.data());
  s_.tree.partials(q, zero_.data(), w_.data(), out.N.data(), dtau_dv_.data(), true);
  out.M.resize(n), s_.tree.dense_M(out.M.data());
}

void VariationalStep::evaluate_endpoint(double t, const double* q, EndpointTerms& out) {
  momentum_partials(q, out);
  const size_t n = nv_, width = 2 * n;
  Vector gravity_forces(s_.tree.bias(), s_.tree.bias() + n);  // nle(q, 0)
  out.D.resize(n), out.dD_dw.resize(n * n);
  s_.generalized_force(t, q, w_.data(), nullptr, out.D.data(), &out.power);
  const double *conservative = s_.law_partials(t, q, w_.data(), nullptr), *other = conservative + n * width;
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j)
      out.dD_dw[i * n + j] = conservative[i * width + n + j] + other[i * width + n + j];
  Vector product(n, 0.0);  // N^T w
  for (size_t j = 0; j < n; ++j)
    for (size_t i = 0; i < n; ++i)
      if (const double N = out.N[j * n + i]; N != 0) product[i] += N * w_[j], out.dD_dw[i * n + j] += N;
  for (size_t i = 0; i < n; ++i) out.D[i] += product[i] / 2 - gravity_forces[i];
}

void VariationalStep::add_transported_momentum_partials(const double* p, double* matrix) {
  if (!s_.manifold.curved()) return;
  Vector minus_x(nv_), unit(nv_);
  for (int i = 0; i < nv_; ++i) minus_x[i] = -x_[i];
  std::vector<TangentBlock> partials;
  for (int k = 0; k < 6; ++k) {
    std::fill(unit.begin(), unit.end(), 0.0);
    for (const TangentBlock& b : J_minus_)
      if (k < b.n) unit[b.start + k] = 1;
    s_.manifold.partials(minus_x.data(), unit.data(), partials);
    for (const TangentBlock& b : partials)
      for (int j = 0; j < b.n && k < b.n; ++j) {
        double sum = 0;
        for (int i = 0; i < b.n; ++i) sum += p[b.start + i] * b.dJv[i * b.n + j];
        matrix[static_cast<size_t>(b.start + k) * nv_ + b.start + j] -= sum;
      }
  }
}

void VariationalStep::correct(Vector& dx) {
  const std::vector<int>& rows = s_.rows.in_use();
  const int n = nv_, r = static_cast<int>(rows.size());
  const double *x = x_.data(), *lam = x + n;
  Vector minus_x(n);
  for (int i = 0; i < n; ++i) w_[i] = x[i] / h_, minus_x[i] = -x[i];
  s_.manifold.check_rotations(x);
  evaluate_endpoint(t_, q0_.data(), start_);
  s_.manifold.integrate(q0_.data(), x, q1_.data());
  momentum_partials(q1_.data(), end_);
  s_.counts.G += s_.ng > 0;
  s_.constraints.dense_value(s_.tree, q1_.data(), rows, G_, g_.data());
  s_.constraints.complete_g(t_ + h_, g_.data());
  if (s_.manifold.curved()) {
    s_.manifold.transfer(zero_.data(), x, J_inverse_);
    s_.manifold.partials(minus_x.data(), zero_.data(), J_minus_);
  }
  matrix_.resize(static_cast<size_t>(n) * n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const size_t entry = static_cast<size_t>(i) * n + j;
      start_.M[entry] = (start_.M[entry] + end_.M[entry]) / 2, matrix_[entry] = end_.N[entry] / 2;
    }
  const Vector& mean = start_.M;
  multiply(mean, w_.data(), n, mean_.data());
  for (int i = 0; i < n; ++i) {
    double* row = &matrix_[static_cast<size_t>(i) * n];
    multiply_transposed(J_inverse_, row);
    for (int j = 0; j < n; ++j) row[j] += mean[static_cast<size_t>(i) * n + j] / h_;
  }
  for (int j = 0; j < n; ++j) multiply_transposed(J_minus_, &matrix_[j], n);
  add_transported_momentum_partials(mean_.data(), matrix_.data());
  lu_.resize(n + r);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const size_t entry = static_cast<size_t>(i) * n + j;
      if (const double x = matrix_[entry] - start_.dD_dw[entry] / 2; x != 0) lu_.column(j)[i] = h_ * x;
    }
  multiply_transposed(J_minus_, mean_.data());
  for (int i = 0; i < n; ++i) dx[i] = p_[i] - mean_[i] + h_ / 2 * start_.D[i];
  for (int k = 0; k < r; ++k) {
    const double* G = &G0_[static_cast<size_t>(k) * n];
    for (int i = 0; i < n; ++i) dx[i] += h_ / 2 * lam[k] * G[i], lu_.column(n + k)[i] = -G[i];
    double* row = &G_[static_cast<size_t>(rows[k]) * n];
    multiply_transposed(J_inverse_, row);
    for (int j = 0; j < n; ++j)
      if (row[j] != 0) lu_.column(j)[n + k] = row[j];
    dx[n + k] = -g_[rows[k]];
  }
  for (int i = 0; i < n; ++i) dx[i] *= h_;
  s_.counts.factorizations += 1, s_.counts.solves += 1;
  if (!lu_.factorize()) throw FallBackToPython();
  lu_.solve(dx.data());
  for (int k = 0; k < r; ++k) dx[n + k] *= 2 / (h_ * h_);
}

std::pair<double, double> VariationalStep::change_and_scale(const Vector& dx) const {
  const Tolerances& tolerances = s_.tree.tolerances;
  double size = tolerances.tiny, change = 0, position = 0;
  for (int i = 0; i < nv_; ++i) {
    size = std::max(size, std::fabs(x_[i]) / tolerances.coordinate_scales[i]);
    change = std::max(change, std::fabs(dx[i]) / tolerances.coordinate_scales[i]);
    if (!std::isfinite(dx[i])) change = dx[i];
  }
  for (int i = 0; i < nq_; ++i) position = std::max(position, std::fabs(q0_[i]) / tolerances.q_scales[i]);
  return {change / size, (1 + position) / size};
}

void VariationalStep::rattle(const NewtonIteration& iteration, double t, double h, const State& in, State& out,
                             double* z) {
  const double* y = in.y.data();
  t_ = t, h_ = h, q0_.assign(y, y + nq_), v0_.assign(y + nq_, y + nq_ + nv_);
  if (!s_.point.is_current(y)) s_.point.evaluate(y, true);
  s_.select_rows_of_step(y);
  const std::vector<int>& rows = s_.rows.in_use();
  const int n = nv_, r = static_cast<int>(rows.size());
  G0_.assign(static_cast<size_t>(r) * n, 0.0);
  for (int k = 0; k < r; ++k) s_.constraints.expand(rows[k], s_.point.G.data(), &G0_[static_cast<size_t>(k) * n]);
  momentum_partials(y, start_);
  multiply(start_.M, v0_.data(), n, p_.data());
  x_.assign(n + r, 0.0);
  for (int i = 0; i < n; ++i) x_[i] = h * v0_[i];
  solve_by_newton(
      iteration, s_.counts, x_, [&](Vector& dx) { correct(dx); },
      [&](const Vector& dx) { return change_and_scale(dx); });

  for (int i = 0; i < n; ++i) w_[i] = x_[i] / h;
  evaluate_endpoint(t, q0_.data(), start_);
  s_.manifold.integrate(q0_.data(), x_.data(), q1_.data());
  evaluate_endpoint(t + h, q1_.data(), end_);
  Vector momentum(n), impulse(s_.ng), g_t(s_.ng, 0.0), dy(s_.ny, 0.0);
  for (size_t i = 0; i < start_.M.size(); ++i) start_.M[i] += end_.M[i];
  multiply(start_.M, w_.data(), n, momentum.data());
  if (s_.manifold.curved()) {
    s_.manifold.partials(x_.data(), zero_.data(), J_plus_);
    multiply_transposed(J_plus_, momentum.data());
  }
  for (int i = 0; i < n; ++i) momentum[i] = momentum[i] / 2 + h / 2 * end_.D[i];
  s_.constraints.evaluate_g_t(t + h, g_t.data());
  for (int k = 0; k < s_.ng; ++k) impulse[k] = -g_t[k];
  s_.point.evaluate(q1_.data(), true);
  s_.saddle.factorize_symmetric();
  s_.saddle.solve(s_.point.Z, impulse.data(), momentum.data());
  double power = start_.power + end_.power;
  for (int k : rows) impulse[k] *= 2 / h, power -= impulse[k] * g_t[k];
  if (s_.driven()) {
    std::fill(g_t.begin(), g_t.end(), 0.0);
    s_.constraints.evaluate_g_t(t, g_t.data());
    for (int k = 0; k < r; ++k) power -= x_[n + k] * g_t[rows[k]];
  }
  for (int i = 0; i < n; ++i) dy[i] = x_[i], dy[n + i] = momentum[i] - v0_[i];
  dy[2 * n] = h / 2 * power;
  out.carry.clear(), out.memory.reset();
  s_.move(in, dy.data(), out);
  s_.saddle.all_multipliers(impulse.data(), z);
  s_.probe_other_rows();
  if (!finite(out.y.data(), s_.length)) throw FallBackToPython();
}

void VariationalStep::take(const Composition& composition, double t, double h, const State& in, State& out, double* z) {
  State start = in;
  for (size_t i = 0; i < composition.weights.size(); ++i) {
    rattle(composition.iteration, t + composition.nodes[i] * h, composition.weights[i] * h, start, out, z);
    if (i + 1 < composition.weights.size()) std::swap(start, out);
  }
}

}  // namespace mbdae
