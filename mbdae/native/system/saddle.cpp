#include "system/saddle.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

SaddleSystem::SaddleSystem(const Configuration& point, const Constraints& constraints, IndependentRows& rows,
                           const Tolerances& limits, Counts& counts, int nv)
    : point_(point), constraints_(constraints), rows_(rows), limits_(limits), counts_(counts), nv_(nv) {}

// Four independent partial sums.
void SaddleSystem::assemble(const Numbers& Zhat) {
  const std::vector<int>& rows = rows_.in_use();
  const int r = static_cast<int>(rows.size());
  if (version_ != rows_.version()) {
    lu_.resize(r, rows_.half_bandwidth()), x_.resize(std::max(nv_, r));
    version_ = rows_.version();
  } else {
    lu_.zero();
  }
  const bool mirrored = &Zhat == &point_.Z;
  const auto z = [&](int i) { return point_.Z.data() + static_cast<size_t>(rows[i]) * nv_; };
  const auto zhat = [&](int i) { return Zhat.data() + static_cast<size_t>(rows[i]) * nv_; };
  for (int i = 0; i < r; ++i) {
    const std::vector<int>&columns = constraints_.rows[rows[i]].columns, &coupled = rows_.coupled(i);
    const size_t last = coupled.size() - 1;  // i itself
    const double *a = zhat(i), *b = z(i);
    for (size_t m = 0; mirrored && m <= last; m += 4) {
      const int j = coupled[m], k = coupled[std::min(m + 1, last)], l = coupled[std::min(m + 2, last)],
                n = coupled[std::min(m + 3, last)];
      const double *zj = z(j), *zk = z(k), *zl = z(l), *zn = z(n);
      double sj = 0, sk = 0, sl = 0, sn = 0;
      for (int c : columns) sj += a[c] * zj[c], sk += a[c] * zk[c], sl += a[c] * zl[c], sn += a[c] * zn[c];
      lu_.at(i, j) = lu_.at(j, i) = sj, lu_.at(i, k) = lu_.at(k, i) = sk;
      lu_.at(i, l) = lu_.at(l, i) = sl, lu_.at(i, n) = lu_.at(n, i) = sn;
    }
    for (size_t m = 0; !mirrored && m <= last; m += 2) {
      const int j = coupled[m], k = coupled[std::min(m + 1, last)];
      const double *zj = z(j), *zk = z(k), *hj = zhat(j), *hk = zhat(k);
      double ij = 0, ji = 0, ik = 0, ki = 0;
      for (int c : columns) ij += a[c] * zj[c], ji += hj[c] * b[c], ik += a[c] * zk[c], ki += hk[c] * b[c];
      lu_.at(i, j) = ij, lu_.at(j, i) = ji, lu_.at(i, k) = ik, lu_.at(k, i) = ki;
    }
  }
}

void SaddleSystem::factorize(const Numbers& Zhat) {
  symmetric_stamp_ = -1;
  if (rows_.in_use().empty()) return;
  assemble(Zhat);
  const bool regular = lu_.factorize();
  if (!regular || !(lu_.pivot_ratio() > limits_.smallest_pivot)) throw FallBackToPython();
}

bool SaddleSystem::factorize_symmetric(double least_ratio) {
  if (symmetric_stamp_ != point_.stamp() || version_ != rows_.version()) {
    symmetric_stamp_ = -1;
    if (!rows_.in_use().empty()) assemble(point_.Z);
    if (!rows_.in_use().empty() && !lu_.factorize()) return false;
    symmetric_stamp_ = point_.stamp();
  }
  return rows_.in_use().empty() || lu_.pivot_ratio() > least_ratio;
}

void SaddleSystem::solve(const Numbers& Zhat, double* rhs, double* f) {
  counts_.solves += 1;
  if (!rows_.in_use().empty()) counts_.factorizations += 1, rows_.record_ratio(lu_.pivot_ratio());
  solve_uncounted(Zhat, rhs, f);
}

void SaddleSystem::solve_uncounted(double* rhs, double* f) {
  const bool by_selection = !constraints_.sticks && rows_.factorize(point_.Z.data(), point_.stamp());
  x_.resize(std::max(x_.size(), rows_.in_use().size()));
  if (!by_selection) factorize_symmetric();
  solve_uncounted(point_.Z, rhs, f, by_selection);
}

void SaddleSystem::solve_uncounted(const Numbers& Zhat, double* rhs, double* f, bool by_selection) {
  point_.solve_root(f);
  const std::vector<int>& position = rows_.position();
  const bool refine = constraints_.sticks;  // one step of iterative refinement
  if (refine) rhs_.assign(rhs, rhs + position.size());
  for (int i = 0; i <= refine && !rows_.in_use().empty(); ++i) {
    for (int k : rows_.in_use()) {
      double s = i ? rhs_[k] : rhs[k];
      for (int c : constraints_.rows[k].columns) s -= Zhat[static_cast<size_t>(k) * nv_ + c] * f[c];
      x_[position[k]] = s;
    }
    by_selection ? rows_.solve(x_.data()) : lu_.solve(x_.data());
    for (int k : rows_.in_use()) {
      const double l = x_[position[k]];
      rhs[k] = i ? rhs[k] + l : l;
      const double* z = &point_.Z[static_cast<size_t>(k) * nv_];
      for (int c : constraints_.rows[k].columns) f[c] += z[c] * l;
    }
  }
  point_.solve_root_transposed(f);
  if (!finite(f, nv_)) throw FallBackToPython();
}

void SaddleSystem::factorize_symmetric() {
  if (!factorize_symmetric(limits_.smallest_pivot)) throw FallBackToPython();
}

void SaddleSystem::minimum_norm_motion(const double* by_row, double* out, double* multipliers) {
  const std::vector<int>& position = rows_.position();
  for (int k : rows_.in_use()) x_[position[k]] = by_row[k];
  lu_.solve(x_.data());
  std::fill(out, out + nv_, 0.0);
  for (int k : rows_.in_use())
    for (int c : constraints_.rows[k].columns) out[c] += point_.Z[static_cast<size_t>(k) * nv_ + c] * x_[position[k]];
  if (multipliers)
    for (int k : rows_.in_use()) multipliers[k] = x_[position[k]];
  point_.solve_root_transposed(out);
}

void SaddleSystem::update_multipliers(double* left, double* lam) {
  const std::vector<int>& position = rows_.position();
  point_.solve_root(left);
  for (int k : rows_.in_use()) {
    double s = 0;
    for (int c : constraints_.rows[k].columns) s += point_.Z[static_cast<size_t>(k) * nv_ + c] * left[c];
    x_[position[k]] = s;
  }
  lu_.solve(x_.data());
  for (int k : rows_.in_use()) lam[k] -= x_[position[k]];
}

// A vector in the null space of the rows in use is in that of the rows that depend on them.
bool SaddleSystem::others_depend(const Numbers& probe) {
  const std::vector<int>& position = rows_.position();
  Numbers w(probe);
  double scale = 0;
  for (int k : rows_.in_use()) {
    double s = 0, size = 0;
    for (int c : constraints_.rows[k].columns) {
      const double zc = point_.Z[static_cast<size_t>(k) * nv_ + c];
      s += zc * w[c], size += zc * zc;
    }
    x_[position[k]] = s, scale = std::max(scale, size);
  }
  lu_.solve(x_.data());
  for (int k : rows_.in_use())
    for (int c : constraints_.rows[k].columns) w[c] -= point_.Z[static_cast<size_t>(k) * nv_ + c] * x_[position[k]];
  for (int k : rows_.others()) {
    double s = 0;
    for (int c : constraints_.rows[k].columns) s += point_.Z[static_cast<size_t>(k) * nv_ + c] * w[c];
    if (s * s > limits_.probe_tolerance * limits_.probe_tolerance * scale) return false;
  }
  return true;
}

double SaddleSystem::product(int k, int l) const {
  double s = 0;
  for (int c : constraints_.rows[k].columns)
    s += point_.Z[static_cast<size_t>(k) * nv_ + c] * point_.Z[static_cast<size_t>(l) * nv_ + c];
  return s;
}

// Dependent rows G_D = C G_R give the null vectors (-C^T n, n) of G^T, and (1 + C C^T) n = C lam_R; by conjugate
// gradients, C = G_D M^-1 G_R^T (G_R M^-1 G_R^T)^-1.
void SaddleSystem::all_multipliers(const double* lam, double* z) {
  const std::vector<int>& position = rows_.position();
  const std::vector<int>& others = rows_.others();
  const size_t ng = position.size();
  for (size_t k = 0; k < ng; ++k) z[k] = position[k] >= 0 ? lam[k] : 0.0;
  if (!rows_.dependent()) return;
  const int d = static_cast<int>(others.size());
  u_.resize(rows_.in_use().size()), n_.assign(d, 0.0), residual_.resize(d), p_.resize(d), Ap_.resize(d);
  couplings_.clear();
  for (int i = 0; i < d; ++i)
    for (int l : rows_.neighbours(others[i]))
      if (position[l] >= 0) couplings_.push_back({i, position[l], product(others[i], l)});
  auto down = [&](Numbers& u, Numbers& out) {  // out = C u; u is overwritten
    lu_.solve(u.data());
    std::fill(out.begin(), out.end(), 0.0);
    for (const Entry& e : couplings_) out[e.i] += e.s * u[e.j];
  };
  auto up = [&](const Numbers& n, Numbers& out) {  // out = C^T n
    std::fill(out.begin(), out.end(), 0.0);
    for (const Entry& e : couplings_) out[e.j] += e.s * n[e.i];
    lu_.solve(out.data());
  };
  for (int k : rows_.in_use()) u_[position[k]] = lam[k];
  down(u_, residual_);
  p_ = residual_;
  double rho = dot(residual_.data(), residual_.data(), d);
  const double target = limits_.cg_tolerance * rho;
  for (int it = 0; it < d + limits_.extra_cg_iterations && rho > target && rho > 0; ++it) {
    up(p_, u_);
    down(u_, Ap_);
    for (int i = 0; i < d; ++i) Ap_[i] += p_[i];
    const double alpha = rho / dot(p_.data(), Ap_.data(), d);
    for (int i = 0; i < d; ++i) n_[i] += alpha * p_[i], residual_[i] -= alpha * Ap_[i];
    const double next = dot(residual_.data(), residual_.data(), d);
    for (int i = 0; i < d; ++i) p_[i] = residual_[i] + next / rho * p_[i];
    rho = next;
  }
  up(n_, u_);
  for (int k : rows_.in_use()) z[k] -= u_[position[k]];
  for (int i = 0; i < d; ++i) z[others[i]] = n_[i];
  if (!finite(z, static_cast<int>(ng)))
    throw FallBackToPython();  // in a singular configuration Python computes those of minimum norm
}

}  // namespace mbdae
