// Exact partials of the equation in local coordinates, except dgamma/dq by finite differences of order six.
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

Vector LocalCoordinates::gamma_derivative(const Vector& direction) {
  const Vector& D = s_.tree.tolerances.coordinate_scales;
  double size = 0;
  for (int j = 0; j < s_.nv; ++j) size = std::max(size, std::fabs(direction[j]) / D[j]);
  Vector out(s_.ng, 0.0), q(s_.nq), x(s_.nv);
  if (size == 0) return out;
  const double step = limits_.gamma_width / size, weights[3] = {double(3) / 4, -double(3) / 20, double(1) / (3 * 20)};
  for (int k = 1; k <= 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      for (int j = 0; j < s_.nv; ++j) x[j] = sign * k * step * direction[j];
      s_.manifold.integrate(y_.data(), x.data(), q.data());
      const Vector value = gamma(q.data(), &y_[s_.nq]);
      for (int i = 0; i < s_.ng; ++i) out[i] += sign * weights[k - 1] * value[i] / step;
    }
  return out;
}

void LocalCoordinates::forces(double t, Vector& out) {
  out.assign(s_.nv + s_.ns + 1, 0.0);
  s_.generalized_force(t, y_.data(), &y_[s_.nq], &y_[s_.nq + s_.nv], out.data(), &out[s_.nv]);
}

void LocalCoordinates::begin_partials(double t, const double* x, Partials& out, int inputs) {
  const size_t nv = s_.nv, n = size(), width = n + inputs, m = positional_.size();
  const Tolerances& tolerances = s_.tree.tolerances;
  const Vector& D = tolerances.coordinate_scales;
  if (s_.friction) throw std::invalid_argument("friction by closure forces has no partial derivatives");
  Vector y(s_.length);
  state(t, x, y.data());
  Vector tangents(N_), normals(normals_);
  for (size_t i = 0; i < tangents.size(); ++i) tangents[i] *= D[i % nv];
  for (size_t i = 0; i < normals.size(); ++i) normals[i] *= D[i % nv];
  const Vector dx_tangents(tangents), dx_normals(normals);
  velocities(tangents, k_), velocities(normals, r_);
  Vector A(m * r_), b(m * k_);
  for (size_t i = 0; i < m; ++i) {
    const double *row = &G_[positional_[i] * nv], scale = tolerances.row_scales[positional_[i]];
    for (int j = 0; j < r_; ++j) A[m * j + i] = mbdae::dot(row, &normals[j * nv], s_.nv) / scale;
    for (int j = 0; j < k_; ++j) b[m * j + i] = mbdae::dot(row, &tangents[j * nv], s_.nv) / scale;
  }
  const Vector dmu = solve_refined(A, b, m, r_);
  s_.derivative(t, y.data(), F_.data(), z_.data());
  const Vector lam = s_.multipliers();
  s_.partials(t, y.data(), &y[s_.nq], &F_[nv], lam.data(), partials_);
  const size_t r = s_.rows.in_use().size(), u = nv + s_.ns + 1;
  Vector Ba;
  s_.closure_partials(y.data(), &F_[nv], lam.data(), nullptr, &Ba);

  Vector S((r + f_) * nv), v_rhs((r + f_) * n, 0.0), dq(nv * n, 0.0);
  dx_.assign(nv * n, 0.0);
  for (int c = 0; c < k_; ++c) {
    for (size_t j = 0; j < nv; ++j) {
      dx_[c * nv + j] = dx_tangents[c * nv + j], dq[c * nv + j] = tangents[c * nv + j];
      for (int i = 0; i < r_; ++i) {
        dx_[c * nv + j] -= dx_normals[i * nv + j] * dmu[r_ * c + i];
        dq[c * nv + j] -= normals[i * nv + j] * dmu[r_ * c + i];
      }
    }
    add_product(partials_.B.data(), r, nv, &dq[c * nv], &v_rhs[(r + f_) * c]);
    for (size_t i = 0; i < r; ++i) v_rhs[(r + f_) * c + i] *= -1;
  }
  for (size_t i = 0; i < r; ++i)
    for (size_t j = 0; j < nv; ++j) S[(r + f_) * j + i] = partials_.G[i * nv + j];
  for (int i = 0; i < f_; ++i) {
    v_rhs[(r + f_) * (k_ + i) + r + i] = 1;
    for (size_t j = 0; j < nv; ++j) S[(r + f_) * j + r + i] = Nv_[i * nv + j] / D[j];
  }
  const Vector dv = solve_refined(S, v_rhs, r + f_, nv);
  out.y.assign(s_.ny * n, 0.0), out.raw.assign(s_.nq * n, 0.0), force_rhs_.clear(),
      constraint_rhs_.assign(width * r, 0.0);
  for (size_t c = 0; c < n; ++c) {
    Vector tangent(s_.ny, 0.0), force_column(u, 0.0), raw(s_.nq), up(nv), down(nv);
    std::copy_n(&dq[c * nv], nv, tangent.begin()), std::copy_n(&dv[c * nv], nv, tangent.begin() + nv);
    if (c >= static_cast<size_t>(k_ + f_)) tangent[2 * nv + c - k_ - f_] = 1;
    add_product(partials_.K.data(), u, nv, tangent.data(), force_column.data());
    add_product(partials_.D.data(), u, u, &tangent[nv], force_column.data());
    force_rhs_.push_back(force_column);
    s_.tree.tangent_map(y.data(), tangent.data(), raw.data());
    for (int i = 0; i < s_.ny; ++i) out.y[i * n + c] = tangent[i];
    for (int i = 0; i < s_.nq; ++i) out.raw[i * n + c] = raw[i];
    Vector change = gamma_derivative(Vector(tangent.begin(), tangent.begin() + nv));  // gamma is quadratic in v
    for (size_t j = 0; j < nv; ++j) up[j] = y[s_.nq + j] + tangent[nv + j], down[j] = y[s_.nq + j] - tangent[nv + j];
    const Vector gamma_up = gamma(y.data(), up.data()), gamma_down = gamma(y.data(), down.data());
    double* rhs = &constraint_rhs_[c * r];
    for (int i : s_.rows.in_use()) rhs[s_.rows.position()[i]] = change[i] + (gamma_up[i] - gamma_down[i]) / 2;
    add_product(Ba.data(), r, nv, tangent.data(), rhs);
  }
  s_.tree.poses(y.data()), s_.tree.motions(y.data(), &y[s_.nq]);  // for the partials with respect to inputs
}

void LocalCoordinates::complete_partials(int inputs, Partials& out) {
  const size_t nv = s_.nv, n = size(), width = n + inputs, r = s_.rows.in_use().size();
  const Vector& D = s_.tree.tolerances.coordinate_scales;
  s_.point.invalidate();
  DenseLU<1> saddle;
  saddle.resize(static_cast<int>(nv + r));
  for (size_t j = 0; j < nv; ++j) {
    double* column = saddle.column(static_cast<int>(j));
    for (size_t i = 0; i < nv; ++i) column[i] = partials_.M[i * nv + j];
    for (size_t i = 0; i < r; ++i) column[nv + i] = partials_.G[i * nv + j];
  }
  for (size_t k = 0; k < r; ++k) {
    double* column = saddle.column(static_cast<int>(nv + k));
    for (size_t i = 0; i < nv; ++i) column[i] = -partials_.G[k * nv + i];
    std::fill(column + nv, column + nv + r, 0.0);
  }
  if (!saddle.factorize()) throw FallBackToPython();
  out.F.assign(s_.ny * width, 0.0), out.x.assign(n * width, 0.0), out.lam.assign(s_.ng * width, 0.0);
  std::vector<TangentBlock> blocks;
  s_.manifold.partials(displacement_.data(), &y_[s_.nq], blocks);
  for (size_t c = 0; c < width; ++c) {
    const Vector& force_column = force_rhs_[c];
    Vector x(nv + r), rate(s_.ny, 0.0), x_rate(nv);
    std::copy_n(force_column.begin(), nv, x.begin());
    for (size_t i = 0; i < r; ++i) x[nv + i] = -constraint_rhs_[c * r + i];
    saddle.solve(x.data());
    for (size_t j = 0; j < nv && c < n; ++j) rate[j] = x_rate[j] = out.y[(nv + j) * n + c];
    std::copy_n(x.begin(), nv, rate.begin() + nv),
        std::copy(force_column.begin() + nv, force_column.end(), rate.begin() + 2 * nv);
    for (int i = 0; i < s_.ny; ++i) out.F[i * width + c] = rate[i];
    for (int k : s_.rows.in_use()) out.lam[k * width + c] = x[nv + s_.rows.position()[k]];
    if (c < n) s_.manifold.tangent(displacement_.data(), x_rate.data());
    for (const TangentBlock& b : blocks)
      if (c < n) add_product(b.dJv, b.n, b.n, &dx_[c * nv + b.start], &x_rate[b.start]);
    for (int i = 0; i < k_; ++i)
      for (size_t j = 0; j < nv; ++j) out.x[i * width + c] += N_[i * nv + j] * x_rate[j] / D[j];
    for (int i = 0; i < f_; ++i)
      for (size_t j = 0; j < nv; ++j) out.x[(k_ + i) * width + c] += Nv_[i * nv + j] * x[j] / D[j];
    for (int i = 0; i < s_.ns; ++i) out.x[(k_ + f_ + i) * width + c] = force_column[nv + i];
  }
}

}  // namespace mbdae
