// Exact partial derivatives of the equation in local coordinates; dgamma/dq by differences of order six.
#include <algorithm>
#include <stdexcept>

#include "math/dense_lu.hpp"
#include "math/vec3.hpp"
#include "runtime/local_coordinates.hpp"

namespace mbdae {

namespace {

// out += A x, A (m, n) by rows.
void add_product(const double* A, size_t m, size_t n, const double* x, double* out) {
  for (size_t i = 0; i < m; ++i) out[i] += mbdae::dot(A + i * n, x, static_cast<int>(n));
}

}  // namespace

Vector LocalCoordinates::gamma(const double* q, const double* v) {
  Vector out(s_.ng, 0.0);
  s_.tree.poses(q), s_.tree.motions(q, v);
  s_.constraints.bias(s_.tree, q, v, s_.constraints.all, out.data());
  return out;
}

Vector LocalCoordinates::gamma_by_q(const Vector& direction) {
  const Vector& D = s_.tree.limits.coordinate_scales;
  double size = 0;
  for (int j = 0; j < s_.nv; ++j) size = std::max(size, std::fabs(direction[j]) / D[j]);
  Vector out(s_.ng, 0.0), q(s_.nq), x(s_.nv);
  if (size == 0) return out;
  const double width = limits_.gamma_width / size, weights[3] = {double(3) / 4, -double(3) / 20, double(1) / (3 * 20)};
  for (int k = 1; k <= 3; ++k)
    for (const double sense : {1.0, -1.0}) {
      for (int j = 0; j < s_.nv; ++j) x[j] = sense * k * width * direction[j];
      s_.manifold.integrate(y_.data(), x.data(), q.data());
      const Vector here = gamma(q.data(), &y_[s_.nq]);
      for (int i = 0; i < s_.ng; ++i) out[i] += sense * weights[k - 1] * here[i] / width;
    }
  return out;
}

void LocalCoordinates::forces(double t, Vector& out) {
  out.assign(s_.nv + s_.ns + 1, 0.0);
  s_.torque(t, y_.data(), &y_[s_.nq], &y_[s_.nq + s_.nv], out.data(), &out[s_.nv]);
}

void LocalCoordinates::begin_partials(double t, const double* x, Partials& out, int inputs) {
  const size_t nv = s_.nv, n = size(), wide = n + inputs, m = positional_.size();
  const Tolerances& tolerances = s_.tree.limits;
  const Vector& D = tolerances.coordinate_scales;
  if (s_.friction) throw std::invalid_argument("friction by closure forces has no partial derivatives");
  Vector y(s_.length);
  state(t, x, y.data());
  Vector along(N_), across(across_);
  for (size_t i = 0; i < along.size(); ++i) along[i] *= D[i % nv];
  for (size_t i = 0; i < across.size(); ++i) across[i] *= D[i % nv];
  const Vector dx_along(along), dx_across(across);
  velocities(along, k_), velocities(across, r_);
  Vector A(m * r_), b(m * k_);
  for (size_t i = 0; i < m; ++i) {
    const double *row = &G_[positional_[i] * nv], scale = tolerances.row_scales[positional_[i]];
    for (int j = 0; j < r_; ++j) A[m * j + i] = mbdae::dot(row, &across[j * nv], s_.nv) / scale;
    for (int j = 0; j < k_; ++j) b[m * j + i] = mbdae::dot(row, &along[j * nv], s_.nv) / scale;
  }
  const Vector dmu = solved(A, b, m, r_);
  s_.derivative(t, y.data(), F_.data(), z_.data());
  const Vector lam = s_.multipliers();
  s_.partials(t, y.data(), &y[s_.nq], &F_[nv], lam.data(), at_);
  const size_t r = s_.rows.in_use().size(), u = nv + s_.ns + 1;
  Vector Ba;
  s_.closure_partials(y.data(), &F_[nv], lam.data(), nullptr, &Ba);

  Vector S((r + f_) * nv), right((r + f_) * n, 0.0), dq(nv * n, 0.0);
  dx_.assign(nv * n, 0.0);
  for (int c = 0; c < k_; ++c) {
    for (size_t j = 0; j < nv; ++j) {
      dx_[c * nv + j] = dx_along[c * nv + j], dq[c * nv + j] = along[c * nv + j];
      for (int i = 0; i < r_; ++i) {
        dx_[c * nv + j] -= dx_across[i * nv + j] * dmu[r_ * c + i];
        dq[c * nv + j] -= across[i * nv + j] * dmu[r_ * c + i];
      }
    }
    add_product(at_.B.data(), r, nv, &dq[c * nv], &right[(r + f_) * c]);
    for (size_t i = 0; i < r; ++i) right[(r + f_) * c + i] *= -1;
  }
  for (size_t i = 0; i < r; ++i)
    for (size_t j = 0; j < nv; ++j) S[(r + f_) * j + i] = at_.G[i * nv + j];
  for (int i = 0; i < f_; ++i) {
    right[(r + f_) * (k_ + i) + r + i] = 1;
    for (size_t j = 0; j < nv; ++j) S[(r + f_) * j + r + i] = Nv_[i * nv + j] / D[j];
  }
  const Vector dv = solved(S, right, r + f_, nv);
  out.y.assign(s_.ny * n, 0.0), out.raw.assign(s_.nq * n, 0.0), right_.clear(), below_.assign(wide * r, 0.0);
  for (size_t c = 0; c < n; ++c) {
    Vector tangent(s_.ny, 0.0), top(u, 0.0), raw(s_.nq), up(nv), down(nv);
    std::copy_n(&dq[c * nv], nv, tangent.begin()), std::copy_n(&dv[c * nv], nv, tangent.begin() + nv);
    if (c >= static_cast<size_t>(k_ + f_)) tangent[2 * nv + c - k_ - f_] = 1;
    add_product(at_.K.data(), u, nv, tangent.data(), top.data());
    add_product(at_.D.data(), u, u, &tangent[nv], top.data());
    right_.push_back(top);
    s_.tree.tangent_map(y.data(), tangent.data(), raw.data());
    for (int i = 0; i < s_.ny; ++i) out.y[i * n + c] = tangent[i];
    for (int i = 0; i < s_.nq; ++i) out.raw[i * n + c] = raw[i];
    Vector change = gamma_by_q(Vector(tangent.begin(), tangent.begin() + nv));  // gamma is quadratic in v
    for (size_t j = 0; j < nv; ++j) up[j] = y[s_.nq + j] + tangent[nv + j], down[j] = y[s_.nq + j] - tangent[nv + j];
    const Vector above = gamma(y.data(), up.data()), under = gamma(y.data(), down.data());
    double* below = &below_[c * r];
    for (int i : s_.rows.in_use()) below[s_.rows.position()[i]] = change[i] + (above[i] - under[i]) / 2;
    add_product(Ba.data(), r, nv, tangent.data(), below);
  }
  s_.tree.poses(y.data()), s_.tree.motions(y.data(), &y[s_.nq]);  // for the partials with respect to inputs
}

void LocalCoordinates::complete_partials(int inputs, Partials& out) {
  const size_t nv = s_.nv, n = size(), wide = n + inputs, r = s_.rows.in_use().size();
  const Vector& D = s_.tree.limits.coordinate_scales;
  s_.point.invalidate();
  DenseLU<1> saddle;
  saddle.resize(static_cast<int>(nv + r));
  for (size_t j = 0; j < nv; ++j) {
    double* column = saddle.column(static_cast<int>(j));
    for (size_t i = 0; i < nv; ++i) column[i] = at_.M[i * nv + j];
    for (size_t i = 0; i < r; ++i) column[nv + i] = at_.G[i * nv + j];
  }
  for (size_t k = 0; k < r; ++k) {
    double* column = saddle.column(static_cast<int>(nv + k));
    for (size_t i = 0; i < nv; ++i) column[i] = -at_.G[k * nv + i];
    std::fill(column + nv, column + nv + r, 0.0);
  }
  if (!saddle.factorize()) throw FallBackToPython();
  out.F.assign(s_.ny * wide, 0.0), out.x.assign(n * wide, 0.0), out.lam.assign(s_.ng * wide, 0.0);
  std::vector<TangentBlock> blocks;
  s_.manifold.partials(moved_.data(), &y_[s_.nq], blocks);
  for (size_t c = 0; c < wide; ++c) {
    const Vector& top = right_[c];
    Vector x(nv + r), rate(s_.ny, 0.0), moving(nv);
    std::copy_n(top.begin(), nv, x.begin());
    for (size_t i = 0; i < r; ++i) x[nv + i] = -below_[c * r + i];
    saddle.solve(x.data());
    for (size_t j = 0; j < nv && c < n; ++j) rate[j] = moving[j] = out.y[(nv + j) * n + c];
    std::copy_n(x.begin(), nv, rate.begin() + nv), std::copy(top.begin() + nv, top.end(), rate.begin() + 2 * nv);
    for (int i = 0; i < s_.ny; ++i) out.F[i * wide + c] = rate[i];
    for (int k : s_.rows.in_use()) out.lam[k * wide + c] = x[nv + s_.rows.position()[k]];
    if (c < n) s_.manifold.tangent(moved_.data(), moving.data());
    for (const TangentBlock& b : blocks)
      if (c < n) add_product(b.dJv, b.n, b.n, &dx_[c * nv + b.at], &moving[b.at]);
    for (int i = 0; i < k_; ++i)
      for (size_t j = 0; j < nv; ++j) out.x[i * wide + c] += N_[i * nv + j] * moving[j] / D[j];
    for (int i = 0; i < f_; ++i)
      for (size_t j = 0; j < nv; ++j) out.x[(k_ + i) * wide + c] += Nv_[i * nv + j] * x[j] / D[j];
    for (int i = 0; i < s_.ns; ++i) out.x[(k_ + f_ + i) * wide + c] = top[nv + i];
  }
}

}  // namespace mbdae
