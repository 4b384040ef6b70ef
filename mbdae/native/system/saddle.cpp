// Assembly of the banded Schur complement, solutions, and minimum-norm multipliers by conjugate gradients.
#include "system/saddle.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

SaddleSystem::SaddleSystem(const Configuration& point, const Constraints& constraints, IndependentRows& rows,
                           const Tolerances& tolerances, Counts& counts, int nv)
    : point_(point), constraints_(constraints), rows_(rows), tolerances_(tolerances), counts_(counts), nv_(nv) {}

void SaddleSystem::build_coupling_blocks() {
  const std::vector<int>& rows = rows_.in_use();
  blocks_.clear(), common_runs_.clear();
  for (int i = 0; i < static_cast<int>(rows.size()); ++i) {
    const std::vector<int>* columns = nullptr;
    for (int j : rows_.coupled(i)) {
      const std::vector<int>& other_columns = constraints_.rows[rows[j]].columns;
      const bool same = columns && *columns == other_columns;
      const size_t first = same ? blocks_.back().first : common_runs_.size();
      if (!same)
        for (const Constraints::CommonRun& x : constraints_.common(rows[i], rows[j])) common_runs_.push_back(x);
      if (!same || blocks_.back().n == 4)
        blocks_.push_back({i, 0, {}, constraints_.start[rows[i]], {}, first, common_runs_.size()});
      Block& x = blocks_.back();
      x.j[x.n] = j, x.starts[x.n++] = constraints_.start[rows[j]], columns = &other_columns;
    }
  }
}

template <int n, bool symmetric>
void SaddleSystem::multiply(const Block& x, const double* Zhat) {
  const double *Z = point_.Z.data(), *a = Zhat + x.start, *b = Z + x.start, *z[n], *zhat[n];
  double ij[n], ji[n];
  for (int m = 0; m < n; ++m) z[m] = Z + x.starts[m], zhat[m] = Zhat + x.starts[m], ij[m] = ji[m] = 0;
  for (size_t k = x.first; k < x.last; ++k) {
    const Constraints::CommonRun run = common_runs_[k];
    for (int c = 0; c < run.n; ++c)
      for (int m = 0; m < n; ++m) {
        ij[m] += a[run.k + c] * z[m][run.l + c];
        if (!symmetric) ji[m] += zhat[m][run.l + c] * b[run.k + c];
      }
  }
  for (int m = 0; m < n; ++m) lu_.at(x.i, x.j[m]) = ij[m], lu_.at(x.j[m], x.i) = symmetric ? ij[m] : ji[m];
}

void SaddleSystem::assemble(const Vector& Zhat) {
  const int r = static_cast<int>(rows_.in_use().size());
  if (version_ != rows_.version()) {
    lu_.resize(r, rows_.half_bandwidth()), x_.resize(std::max(nv_, r)), build_coupling_blocks();
    version_ = rows_.version();
  } else {
    lu_.zero();
  }
  using Multiply = void (SaddleSystem::*)(const Block&, const double*);
  static constexpr Multiply by_size[2][4] = {
      {&SaddleSystem::multiply<1, false>, &SaddleSystem::multiply<2, false>, &SaddleSystem::multiply<3, false>,
       &SaddleSystem::multiply<4, false>},
      {&SaddleSystem::multiply<1, true>, &SaddleSystem::multiply<2, true>, &SaddleSystem::multiply<3, true>,
       &SaddleSystem::multiply<4, true>}};
  const Multiply* kernels = by_size[&Zhat == &point_.Z];
  for (const Block& x : blocks_) (this->*kernels[x.n - 1])(x, Zhat.data());
}

void SaddleSystem::factorize(const Vector& Zhat) {
  symmetric_stamp_ = -1;
  if (rows_.in_use().empty()) return;
  assemble(Zhat);
  const bool nonsingular = lu_.factorize();
  if (!nonsingular || !(lu_.pivot_ratio() > tolerances_.smallest_pivot)) throw FallBackToPython();
}

bool SaddleSystem::factorize_symmetric(double smallest_ratio) {
  if (symmetric_stamp_ != point_.stamp() || version_ != rows_.version()) {
    symmetric_stamp_ = -1;
    if (!rows_.in_use().empty()) assemble(point_.Z);
    if (!rows_.in_use().empty() && !lu_.factorize()) return false;
    symmetric_stamp_ = point_.stamp();
  }
  return rows_.in_use().empty() || lu_.pivot_ratio() > smallest_ratio;
}

void SaddleSystem::solve(const Vector& Zhat, double* rhs, double* f) {
  counts_.solves += 1;
  if (!rows_.in_use().empty()) counts_.factorizations += 1, rows_.record_ratio(lu_.pivot_ratio());
  solve_uncounted(Zhat, rhs, f);
}

void SaddleSystem::solve_uncounted(double* rhs, double* f) {
  const bool use_selection_factors = !constraints_.has_sticking_joints && rows_.factorize(point_.Z, point_.stamp());
  x_.resize(std::max(x_.size(), rows_.in_use().size()));
  if (!use_selection_factors) factorize_symmetric();
  solve_uncounted(point_.Z, rhs, f, use_selection_factors);
}

void SaddleSystem::solve_uncounted(const Vector& Zhat, double* rhs, double* f, bool use_selection_factors) {
  point_.solve_root(f);
  const std::vector<int>& position = rows_.position();
  const bool refine = constraints_.has_sticking_joints;  // one step of iterative refinement
  if (refine) rhs_.assign(rhs, rhs + position.size());
  for (int i = 0; i <= refine && !rows_.in_use().empty(); ++i) {
    for (int k : rows_.in_use()) {
      double s = i ? rhs_[k] : rhs[k];
      const double* z = Zhat.data() + constraints_.start[k];
      for (int c : constraints_.rows[k].columns) s -= *z++ * f[c];
      x_[position[k]] = s;
    }
    use_selection_factors ? rows_.solve(x_.data()) : lu_.solve(x_.data());
    for (int k : rows_.in_use()) {
      const double l = x_[position[k]];
      rhs[k] = i ? rhs[k] + l : l;
      constraints_.add(k, point_.Z, l, f);
    }
  }
  point_.solve_root_transposed(f);
  if (!finite(f, nv_)) throw FallBackToPython();
}

void SaddleSystem::factorize_symmetric() {
  if (!factorize_symmetric(tolerances_.smallest_pivot)) throw FallBackToPython();
}

void SaddleSystem::minimum_norm_correction(const double* r, double* out, double* multipliers) {
  const std::vector<int>& position = rows_.position();
  for (int k : rows_.in_use()) x_[position[k]] = r[k];
  lu_.solve(x_.data());
  std::fill(out, out + nv_, 0.0);
  for (int k : rows_.in_use()) constraints_.add(k, point_.Z, x_[position[k]], out);
  if (multipliers)
    for (int k : rows_.in_use()) multipliers[k] = x_[position[k]];
  point_.solve_root_transposed(out);
}

void SaddleSystem::update_multipliers(double* residual, double* lam) {
  const std::vector<int>& position = rows_.position();
  point_.solve_root(residual);
  for (int k : rows_.in_use()) x_[position[k]] = constraints_.times(k, point_.Z, residual);
  lu_.solve(x_.data());
  for (int k : rows_.in_use()) lam[k] -= x_[position[k]];
}

void SaddleSystem::project_onto_null_space(Vector& w) {
  const std::vector<int>& position = rows_.position();
  for (int k : rows_.in_use()) x_[position[k]] = constraints_.times(k, point_.Z, w.data());
  lu_.solve(x_.data());
  for (int k : rows_.in_use()) constraints_.add(k, point_.Z, -x_[position[k]], w.data());
}

// Rows dependent on the rows in use vanish on their null space: test one vector of it.
bool SaddleSystem::remaining_rows_dependent(const Vector& probe) {
  Vector w(probe);
  project_onto_null_space(w);
  double scale = 0;
  for (int k : rows_.in_use()) scale = std::max(scale, constraints_.product(k, k, point_.Z.data()));
  for (int k : rows_.remaining()) {
    const double s = constraints_.times(k, point_.Z, w.data());
    if (s * s > tolerances_.probe_tolerance * tolerances_.probe_tolerance * scale) return false;
  }
  return true;
}

// Dependent rows G_D = C G_I of the rows in use G_I give the null vectors (-C^T n, n) of G^T; (I + C C^T) n = C lam_I is
// solved by conjugate gradients with C = G_D M^-1 G_I^T (G_I M^-1 G_I^T)^-1.
void SaddleSystem::all_multipliers(const double* lam, double* z) {
  const std::vector<int>& position = rows_.position();
  const std::vector<int>& remaining = rows_.remaining();
  const size_t ng = position.size();
  for (size_t k = 0; k < ng; ++k) z[k] = position[k] >= 0 ? lam[k] : 0.0;
  if (!rows_.dependent()) return;
  const int d = static_cast<int>(remaining.size());
  u_.resize(rows_.in_use().size()), n_.assign(d, 0.0), residual_.resize(d), p_.resize(d), Ap_.resize(d);
  couplings_.clear();
  for (int i = 0; i < d; ++i)
    for (int l : rows_.neighbours(remaining[i]))
      if (position[l] >= 0)
        couplings_.push_back({i, position[l], constraints_.product(remaining[i], l, point_.Z.data())});
  auto apply_C = [&](Vector& u, Vector& out) {  // out = C u; u is overwritten
    lu_.solve(u.data());
    std::fill(out.begin(), out.end(), 0.0);
    for (const Entry& e : couplings_) out[e.i] += e.s * u[e.j];
  };
  auto apply_C_transposed = [&](const Vector& n, Vector& out) {  // out = C^T n
    std::fill(out.begin(), out.end(), 0.0);
    for (const Entry& e : couplings_) out[e.j] += e.s * n[e.i];
    lu_.solve(out.data());
  };
  for (int k : rows_.in_use()) u_[position[k]] = lam[k];
  apply_C(u_, residual_);
  p_ = residual_;
  double rho = dot(residual_.data(), residual_.data(), d);
  if (rho == 0) return;  // the norm is already minimal: dependent rows vanish, or C lam does
  const double target = tolerances_.cg_tolerance * rho;
  for (int it = 0; it < d + tolerances_.extra_cg_iterations && rho > target && rho > 0; ++it) {
    apply_C_transposed(p_, u_);
    apply_C(u_, Ap_);
    for (int i = 0; i < d; ++i) Ap_[i] += p_[i];
    const double alpha = rho / dot(p_.data(), Ap_.data(), d);
    for (int i = 0; i < d; ++i) n_[i] += alpha * p_[i], residual_[i] -= alpha * Ap_[i];
    const double next = dot(residual_.data(), residual_.data(), d);
    for (int i = 0; i < d; ++i) p_[i] = residual_[i] + next / rho * p_[i];
    rho = next;
  }
  apply_C_transposed(n_, u_);
  for (int k : rows_.in_use()) z[k] -= u_[position[k]];
  for (int i = 0; i < d; ++i) z[remaining[i]] = n_[i];
  if (!finite(z, static_cast<int>(ng)))
    throw FallBackToPython();  // in singular configurations Python computes the minimum-norm multipliers
}

}  // namespace mbdae
