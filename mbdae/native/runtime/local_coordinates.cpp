// The chart of the constraint manifold: bases, projection onto the constraints, state and rate.
#include "runtime/local_coordinates.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// Orthonormal bases of the row space of rows (n, nv) and of its complement, stored by rows, by pivoted Gram-Schmidt.
void row_and_null_space(const Vector& rows, size_t nv, double truncation, Vector& basis, Vector& complement) {
  basis.clear(), complement.clear();
  const auto orthogonalize = [&](Vector& x) {  // twice, to rounding
    for (int pass = 0; pass < 2; ++pass)
      for (const Vector* vectors : {&basis, &complement})
        for (size_t k = 0; k < vectors->size(); k += nv) {
          const double component = mbdae::dot(&(*vectors)[k], x.data(), static_cast<int>(nv));
          for (size_t i = 0; i < nv; ++i) x[i] -= component * (*vectors)[k + i];
        }
    return norm(x.data(), static_cast<int>(nv));
  };
  const auto extend = [&](const Vector& candidates, Vector& target, double tolerance) {  // largest residual first
    std::vector<Vector> remaining;
    for (auto x = candidates.begin(); x != candidates.end(); x += nv) remaining.emplace_back(x, x + nv);
    double first = 0;
    while (!remaining.empty()) {
      size_t pivot = 0;
      double largest = -1;
      for (size_t i = 0; i < remaining.size(); ++i) {
        const double size = orthogonalize(remaining[i]);
        if (size > largest) largest = size, pivot = i;
      }
      if (first == 0) first = largest;
      if (!(largest > tolerance * first) || basis.size() + complement.size() == nv * nv) return;
      for (double& x : remaining[pivot]) x /= largest;
      target.insert(target.end(), remaining[pivot].begin(), remaining[pivot].end());
      remaining.erase(remaining.begin() + pivot);
    }
  };
  extend(rows, basis, truncation);
  Vector unit(nv * nv, 0.0);
  for (size_t i = 0; i < nv; ++i) unit[(nv + 1) * i] = 1;
  extend(unit, complement, 0);
}

}  // namespace

Vector solve_refined(const Vector& A, const Vector& B, size_t m, size_t n) {
  const size_t k = m ? B.size() / m : 0;
  Vector out(n * k, 0.0);
  if (!n || !k) return out;
  Vector residual(B);
  for (int pass = 0; pass < 2; ++pass) {
    Vector a(A), b(residual);
    least_squares(static_cast<int>(m), static_cast<int>(n), a.data(), static_cast<int>(k), b.data());
    for (size_t j = 0; j < k; ++j)
      for (size_t i = 0; i < n; ++i) {
        out[n * j + i] += b[m * j + i];
        for (size_t l = 0; l < m; ++l) residual[m * j + l] -= A[m * i + l] * b[m * j + i];
      }
  }
  return out;
}

LocalCoordinates::LocalCoordinates(Index2System& s, const CoordinateLimits& limits, double t, const double* y)
    : s_(s),
      limits_(limits),
      q0_(y, y + s.nq),
      displacement_(s.nv),
      q_(q0_),
      g_(s.ng),
      G_(static_cast<size_t>(s.ng) * s.nv),
      y_(y, y + s.length),
      F_(s.ny),
      z_(s.ng) {
  const Tolerances& tolerances = s.tree.tolerances;
  const Vector& D = tolerances.coordinate_scales;
  const size_t nv = s.nv;
  evaluate_rows(t, y);
  Vector all, positional, none;
  for (int i = 0; i < s.ng; ++i) {
    Vector row(nv);
    for (size_t j = 0; j < nv; ++j) row[j] = G_[i * nv + j] * D[j] / tolerances.row_scales[i];
    all.insert(all.end(), row.begin(), row.end());
    if (!s.constraints.rows[i].positional || is_inactive(i)) continue;
    positional_.push_back(i), positional.insert(positional.end(), row.begin(), row.end());
  }
  row_and_null_space(positional, nv, tolerances.truncation, normals_, N_);
  row_and_null_space(all, nv, tolerances.truncation, none, Nv_);
  r_ = static_cast<int>(normals_.size() / nv), k_ = static_cast<int>(N_.size() / nv);
  f_ = static_cast<int>(Nv_.size() / nv);
  origin_t0_ = t, first_xi_.assign(k_, 0.0), first_mu_.assign(r_, 0.0);
  last_t_ = t, last_xi_ = first_xi_, last_mu_ = first_mu_;
  x0_ = first_xi_;
  for (int i = 0; i < f_; ++i) {
    double eta = 0;
    for (size_t j = 0; j < nv; ++j) eta += Nv_[i * nv + j] * y[s.nq + j] / D[j];
    x0_.push_back(eta);
  }
  x0_.insert(x0_.end(), y + s.nq + nv, y + s.nq + nv + s.ns);
}

void LocalCoordinates::evaluate_rows(double t, const double* q) {
  std::fill(G_.begin(), G_.end(), 0.0);
  s_.point.invalidate(), s_.tree.poses(q);
  s_.constraints.dense_value(s_.tree, q, s_.constraints.all, G_, g_.data());
  s_.constraints.complete_g(t, g_.data());
}

void LocalCoordinates::set_displacement(const Vector& xi, const Vector& mu) {
  const size_t nv = s_.nv;
  for (size_t j = 0; j < nv; ++j) {
    double x = 0;
    for (int i = 0; i < k_; ++i) x += N_[i * nv + j] * xi[i];
    for (int i = 0; i < r_; ++i) x += normals_[i * nv + j] * mu[i];
    displacement_[j] = s_.tree.tolerances.coordinate_scales[j] * x;
  }
}

void LocalCoordinates::velocities(Vector& columns, int n) const {
  for (int i = 0; i < n; ++i) s_.manifold.velocity(displacement_.data(), &columns[static_cast<size_t>(i) * s_.nv]);
}

bool LocalCoordinates::project(double t, const Vector& xi, Vector& mu) {
  const size_t nv = s_.nv, m = positional_.size();
  const Tolerances& tolerances = s_.tree.tolerances;
  double size = 0, last = INFINITY;
  for (int pass = 0; pass < limits_.iterations; ++pass) {
    set_displacement(xi, mu);
    s_.manifold.integrate(q0_.data(), displacement_.data(), q_.data());
    evaluate_rows(t, q_.data());
    size = 0;
    for (int i : positional_) size = std::max(size, std::fabs(g_[i]) / tolerances.row_scales[i]);
    if (!(tolerances.eps < size && size < last)) break;
    last = size;
    Vector directions(normals_), A(m * r_), b;
    for (size_t i = 0; i < directions.size(); ++i) directions[i] *= tolerances.coordinate_scales[i % nv];
    velocities(directions, r_);
    for (int j = 0; j < r_; ++j)
      for (size_t i = 0; i < m; ++i)
        A[m * j + i] =
            mbdae::dot(&G_[positional_[i] * nv], &directions[j * nv], s_.nv) / tolerances.row_scales[positional_[i]];
    for (int i : positional_) b.push_back(g_[i] / tolerances.row_scales[i]);
    const Vector step = solve_refined(A, b, m, r_);
    if (!(mbdae::largest(step.data(), r_) <= limits_.largest_step)) return false;
    for (int i = 0; i < r_; ++i) mu[i] -= step[i];
  }
  return std::min(size, last) <= limits_.closed;
}

void LocalCoordinates::position(double t, const double* xi) {
  std::vector<std::pair<double, Vector>> targets{{t, Vector(xi, xi + k_)}};
  while (!targets.empty()) {
    Vector mu(last_mu_);
    if (project(targets.back().first, targets.back().second, mu)) {
      last_t_ = targets.back().first, last_xi_ = targets.back().second, last_mu_ = std::move(mu), targets.pop_back();
      continue;
    }
    if (static_cast<int>(targets.size()) > limits_.halvings) {
      last_t_ = origin_t0_, last_xi_ = first_xi_, last_mu_ = first_mu_;
      throw StepTooLong();
    }
    auto middle = targets.back();
    middle.first = (middle.first + last_t_) / 2;
    for (int i = 0; i < k_; ++i) middle.second[i] = (middle.second[i] + last_xi_[i]) / 2;
    targets.push_back(std::move(middle));
  }
}

void LocalCoordinates::state(double t, const double* x, double* y) {
  const size_t nv = s_.nv, m = static_cast<size_t>(s_.ng) + f_;
  const Tolerances& tolerances = s_.tree.tolerances;
  if (!finite(x, size())) throw StepTooLong();
  position(t, x);
  Vector A(m * nv), b(m * (1 + f_), 0.0);  // right-hand sides of v, and of the velocities of unit eta
  s_.constraints.evaluate_g_t(t, b.data());
  for (int i = 0; i < s_.ng; ++i) {
    b[i] = is_inactive(i) ? 0 : -b[i] / tolerances.row_scales[i];
    for (size_t j = 0; j < nv; ++j) A[m * j + i] = G_[i * nv + j] / tolerances.row_scales[i];
  }
  for (int i = 0; i < f_; ++i) {
    b[s_.ng + i] = x[k_ + i], b[m * (1 + i) + s_.ng + i] = 1;
    for (size_t j = 0; j < nv; ++j) A[m * j + s_.ng + i] = Nv_[i * nv + j] / tolerances.coordinate_scales[j];
  }
  const Vector v = solve_refined(A, b, m, nv);
  double square = 0;
  for (size_t i = nv; i < v.size(); ++i) square += std::pow(v[i] / tolerances.coordinate_scales[i % nv], 2);
  // The singular values of these velocities are 1/cos of the angles between the null spaces at q and at the origin.
  const double cosine = 1 / std::sqrt(std::max(1.0, square - f_ + 1)), smallest = limits_.smallest_cosine;
  margin_ = std::min((cosine - smallest) / (1 - smallest),
                     1 - s_.manifold.largest_rotation(displacement_.data()) / limits_.largest_rotation);
  double* next = std::copy(q_.begin(), q_.end(), y);
  next = std::copy(v.begin(), v.begin() + nv, next), next = std::copy_n(x + k_ + f_, s_.ns, next), *next = 0;
  y_.assign(y, y + s_.length), t_ = t;
}

void LocalCoordinates::rate(double t, const double* x, double* y, double* dx) {
  const size_t nv = s_.nv;
  const Vector& D = s_.tree.tolerances.coordinate_scales;
  state(t, x, y);
  if (!(margin_ > 0)) throw StepTooLong();
  s_.derivative(t, y, F_.data(), z_.data());
  Vector x_rate(F_.begin(), F_.begin() + nv);
  s_.manifold.tangent(displacement_.data(), x_rate.data());
  std::fill(dx, dx + k_ + f_, 0.0);
  for (int i = 0; i < k_; ++i)
    for (size_t j = 0; j < nv; ++j) dx[i] += N_[i * nv + j] * x_rate[j] / D[j];
  for (int i = 0; i < f_; ++i)
    for (size_t j = 0; j < nv; ++j) dx[k_ + i] += Nv_[i * nv + j] * F_[nv + j] / D[j];
  std::copy_n(&F_[2 * nv], s_.ns, dx + k_ + f_);
}

}  // namespace mbdae
