// Newton iteration of the stages of a collocation method, extrapolation of its stages, error estimate.
#include "steps/collocation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/eigen_types.hpp"
#include "steps/stage_solver.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

using In = Eigen::Map<const Eigen::VectorXd>;

// out (s, n) = h A K, for A (s, s) and K (s, n), by rows.
void combine(const Vector& A, const double* K, int s, int n, double h, double* out) {
  std::fill(out, out + s * n, 0.0);
  for (int i = 0; i < s; ++i) {
    double* o = out + i * n;
    for (int j = 0; j < s; ++j) {
      const double a = A[i * s + j], *k = K + j * n;
      for (int l = 0; l < n; ++l) o[l] += a * k[l];
    }
    for (int l = 0; l < n; ++l) o[l] *= h;
  }
}

// Values (n, s) of the Lagrange polynomials of the nodes c at the points x.
Rows<double> lagrange(const Vector& c, const Vector& x) {
  const int n = static_cast<int>(x.size()), s = static_cast<int>(c.size());
  Rows<double> out = Rows<double>::Ones(n, s);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < s; ++j)
      for (int k = 0; k < s; ++k)
        if (k != j) out(i, j) *= (x[i] - c[k]) / (c[j] - c[k]);
  return out;
}

// Number of iterations after a change of norm `size`, until the next change is below the tolerance.
int remaining_iterations(const Radau& a, double size, double rate) {
  if (rate * size <= a.below_rounding) return 0;
  if (!(rate < 1)) return a.extra_iterations;
  return static_cast<int>(
      std::fmin(a.extra_iterations, std::ceil(std::log(a.below_rounding / size) / std::log(rate)) - 1));
}

}  // namespace

std::shared_ptr<StageMemory> resample(const Radau& a, const StageMemory& m, double delay, double h) {
  auto out = std::make_shared<StageMemory>();
  Vector x(a.c);
  for (double& c : x) c = (delay + c * h) / m.h;
  const Rows<double> L = lagrange(a.c, x);
  const int r = static_cast<int>(m.unknowns.size()), ny = static_cast<int>(m.K.size()) / a.s;
  out->unknowns = m.unknowns, out->h = h, out->rate = INFINITY;
  out->K.resize(m.K.size()), out->Z.resize(m.Z.size());
  MatrixMap(out->K.data(), a.s, ny) = L.lazyProduct(ConstMatrixMap(m.K.data(), a.s, ny));
  MatrixMap(out->Z.data(), a.s, r) = L.lazyProduct(ConstMatrixMap(m.Z.data(), a.s, r));
  return out;
}

CollocationStep::CollocationStep(Index2System& s)
    : s_(s),
      nq_(s.nq),
      nv_(s.nv),
      ns_(s.ns),
      ny_(s.ny),
      y0_(s.length),
      size_(s.ny),
      q_(s.nq),
      u_(s.ny - s.nv),
      f_(s.nv),
      inertial_(s.nv),
      gt_(s.ng),
      lam_(s.ng),
      rates_(s.ng),
      scale_(s.ny) {}

CollocationStep::~CollocationStep() = default;

void CollocationStep::correction(const Radau& a, double t, const StageMemory& m) {
  const int s = a.s, ny = ny_, r = static_cast<int>(m.unknowns.size());
  for (int i = 0; i < s; ++i)
    residual(t + a.c[i] * m.h, &X_[i * ny], &m.K[i * ny], m.Z.data() + i * r, &R_[i * ny], C_.data() + i * r);
  std::fill(dK_.begin(), dK_.end(), 0.0), std::fill(dZ_.begin(), dZ_.end(), 0.0);
  for (size_t i = 0; i < a.modes.size(); ++i) {
    const EigenMode& mode = a.modes[i];
    const bool real = mode.value.imag() == 0;
    std::fill(dk_.begin(), dk_.end(), 0.0), std::fill(dz_.begin(), dz_.end(), 0.0);
    auto project_to_mode = [&](const double* from, int n, double* to) {
      for (int j = 0; j < s; ++j, from += n) {
        const double x = mode.row[j].real(), y = mode.row[j].imag();
        for (int k = 0; k < n; ++k) to[k] += x * from[k];
        for (int k = 0; k < n && !real; ++k) to[n + k] += y * from[k];
      }
    };
    auto add_mode = [&](const double* from, int n, double* to) {
      for (int j = 0; j < s; ++j, to += n) {
        const double x = mode.column[j].real(), y = mode.column[j].imag();
        for (int k = 0; k < n; ++k) to[k] += x * from[k];
        for (int k = 0; k < n && !real; ++k) to[k] -= y * from[n + k];
      }
    };
    project_to_mode(R_.data(), ny, dk_.data()), project_to_mode(C_.data(), r, dz_.data());
    s_.counts.solves += 1;
    m.solvers[i]->solve(dk_.data(), dz_.data(), work_);
    add_mode(dk_.data(), ny, dK_.data()), add_mode(dz_.data(), r, dZ_.data());
  }
}

void CollocationStep::enlarge_scale(const Radau& a, const Vector& displacements) {
  Vector scale(size_);
  double largest_scale = 0;
  for (int k = 0; k < s_.controlled_components(); ++k) {
    double largest = 0;
    for (int i = 0; i < a.s; ++i) largest = std::max(largest, std::fabs(displacements[i * ny_ + k]));
    scale[k] += largest, largest_scale = std::max(largest_scale, scale[k]);
  }
  for (int k = 0; k < s_.controlled_components(); ++k)
    scale_[k] = std::max(scale_[k], scale[k] + a.negligible * largest_scale);
}

bool CollocationStep::solve(const Radau& a, int max_iterations, double accuracy, double t, StageMemory& m) {
  const int s = a.s, ny = ny_, r = static_cast<int>(m.unknowns.size()), n_controlled = s_.controlled_components();
  const double h = m.h, acceptable = std::max(a.iteration_rounding, accuracy);
  for (Vector* x : {&X_, &R_, &dK_, &displacements_}) x->resize(s * ny);
  C_.resize(s * r), dZ_.resize(s * r), dk_.resize(2 * ny), dz_.resize(2 * r);
  combine(a.A, m.K.data(), s, ny, h, X_.data());
  std::fill(scale_.begin(), scale_.end(), 0.0);
  enlarge_scale(a, X_);
  double last = INFINITY, rate = a.expected_rate;
  int remaining = 0;
  for (int k = 0; k < max_iterations; ++k) {
    correction(a, t, m);
    for (int i = 0; i < s * ny; ++i) m.K[i] += dK_[i];
    for (int i = 0; i < s * r; ++i) m.Z[i] += dZ_[i];
    combine(a.A, m.K.data(), s, ny, h, X_.data());
    combine(a.A, dK_.data(), s, ny, h, displacements_.data());
    if (!k) enlarge_scale(a, displacements_);  // from rest without forces, the initial guess predicts no change
    double sum = 0;
    for (int i = 0; i < s; ++i)
      for (int j = 0; j < n_controlled; ++j) {
        const double x = displacements_[i * ny + j] / (scale_[j] + std::numeric_limits<double>::min());
        sum += x * x;
      }
    const double size = std::sqrt(sum / (s * n_controlled));
    s_.counts.newton += 1;
    if (k && last > a.iteration_rounding) rate = k == 1 ? size / last : std::sqrt(rate * size / last);
    if (k ? rate < 1 && rate * size <= accuracy * (1 - rate) : size <= accuracy) {  // the remaining error is smaller
      m.rate = rate;
      return true;
    }
    if (last > a.iteration_rounding) {
      remaining = k ? remaining_iterations(a, size, rate) : a.first_iterations;
    } else {
      --remaining;
    }
    if (size <= a.iteration_rounding && (remaining <= 0 || k == max_iterations - 1)) {
      m.rate = rate;
      return true;
    }
    const bool slow = k > 1 && last > a.iteration_rounding &&
                      (rate >= 1 || std::pow(rate, max_iterations - 1 - k) * size > acceptable);
    if (slow || !std::isfinite(size)) return false;
    last = size;
  }
  return false;
}

void CollocationStep::take(const Radau& a, bool controlled, double t, double h, const State& in, State& out,
                           double* z, Vector& errors) {
  const int s = a.s, max_iterations = controlled ? a.max_iterations_controlled : a.max_iterations;
  const double accuracy = controlled ? s_.accuracy : 0;
  y0_ = in.y;
  const double* y = y0_.data();
  IndependentRows& rows = s_.rows;
  s_.select_rows_of_step(y);
  begin_step(y);
  auto m = std::make_shared<StageMemory>();
  m->unknowns = unknowns();
  const int r = static_cast<int>(m->unknowns.size()), active_rows = static_cast<int>(rows.in_use().size());
  s_.component_magnitudes(y, size_.data());
  const ConstMatrixMap A(a.A.data(), s, s);
  m->h = h, m->K.resize(static_cast<size_t>(s) * ny_), m->Z.resize(s * r);
  MatrixMap K(m->K.data(), s, ny_), Z(m->Z.data(), s, r);
  Eigen::VectorXd F(ny_);
  const StageMemory* previous = in.memory.get();
  if (previous && (previous->unknowns != m->unknowns || previous->K.size() != m->K.size())) previous = nullptr;
  if (previous) {
    const ConstMatrixMap K0(previous->K.data(), s, ny_), Z0(previous->Z.data(), s, r);
    F.head(nv_) = In(y + nq_, nv_), F.tail(ny_ - nv_) = K0.row(s - 1).tail(ny_ - nv_).transpose();
    Vector x(a.c);
    for (double& c : x) c = 1 + c * h / previous->h;
    const Rows<double> L = lagrange(a.c, x);
    K = L.lazyProduct(K0), Z = L.lazyProduct(Z0);
  } else {
    Vector lam(s_.ng);
    s_.derivative(t, y, F.data(), lam.data());
    for (int i = 0; i < s; ++i) {
      K.row(i) = F.transpose();
      for (int j = 0; j < active_rows; ++j) Z(i, j) = s_.multipliers()[m->unknowns[j]];
    }
  }
  bool converged = false;
  if (previous && previous->h == h && previous->rate < a.reuse) {
    const Vector K1(m->K), Z1(m->Z);
    m->partials = previous->partials, m->solvers = previous->solvers;
    try {
      converged = solve(a, max_iterations, accuracy, t, *m);
    } catch (const Interrupted&) {
      throw;
    } catch (const FallBackToPython&) {
    }
    if (!converged) m->K = K1, m->Z = Z1;
  }
  if (!converged) {
    MatrixMap K2(m->K.data(), s, ny_), Z2(m->Z.data(), s, r);
    const Eigen::VectorXd middle_x = h * A.row(a.middle).lazyProduct(K2).transpose();
    m->partials = linearize(t, middle_x.data(), K2.row(a.middle).data(), Z2.row(a.middle).data());
    m->solvers = factorize(a, m->partials, h);
    if (!solve(a, max_iterations, accuracy, t, *m)) throw StepTooLong();
  }
  const ConstMatrixMap K3(m->K.data(), s, ny_), Z3(m->Z.data(), s, r);
  Eigen::VectorXd x = h * A.row(s - 1).lazyProduct(K3).transpose();
  out.carry.clear(), out.memory = m;
  s_.move(in, x.data(), out);
  s_.point.evaluate(out.y.data(), true);
  Eigen::VectorXd R(ny_), C(r);
  CollocationStep::residual(t + h, x.data(), K3.row(s - 1).data(), Z3.row(s - 1).data(), R.data(), C.data());
  std::fill(lam_.begin(), lam_.end(), 0.0);
  for (int i = 0; i < active_rows; ++i) lam_[m->unknowns[i]] = Z3(s - 1, i);
  if (active_rows) {
    s_.saddle.factorize_symmetric();
    for (int i = 0; i < active_rows; ++i) rates_[m->unknowns[i]] = -C[i];
    s_.saddle.minimum_norm_correction(rates_.data(), f_.data());
    for (int i = 0; i < nv_; ++i) {
      x[nv_ + i] -= f_[i];
      out.y[nq_ + i] = y[nq_ + i] + x[nv_ + i];
      out.low[nv_ + i] = x[nv_ + i] - (out.y[nq_ + i] - y[nq_ + i]);
    }
    s_.saddle.update_multipliers(R.data() + nv_, lam_.data());
  }
  all_multipliers(t + h, Z3.row(s - 1).data(), z);
  errors.clear();
  if (controlled) {
    std::shared_ptr<const StageSolver> error_solver;
    if (a.real < 0)
      s_.counts.factorizations += 1, error_solver = make_stage_solver(m->partials, nv_, h * a.gamma);
    else
      error_solver = m->solvers[a.real];
    const ConstMatrixMap M(m->partials->partials.M.data(), nv_, nv_), start(a.start.data(), a.errors, s);
    for (int i = 0; i < a.errors; ++i) {
      Eigen::VectorXd error = h * a.gamma * (F - start.row(i).lazyProduct(K3).transpose());
      error.segment(nv_, nv_) = M.lazyProduct(error.segment(nv_, nv_)).eval();
      std::fill(dz_.begin(), dz_.end(), 0.0);
      s_.counts.solves += 1;
      error_solver->solve(error.data(), dz_.data(), work_);
      errors.insert(errors.end(), error.data(), error.data() + ny_);
    }
  }
  if (!finite(out.y.data(), s_.length) || !finite(z, s_.nz)) throw FallBackToPython();
}

}  // namespace mbdae
