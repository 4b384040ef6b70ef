#include "collocation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stage_solver.hpp"
#include "vec3.hpp"

namespace mbdae {

namespace {

// The Lagrange polynomials of the nodes c at the points x, (n, s).
Rows<double> lagrange(const Numbers& c, const Numbers& x) {
  const int n = static_cast<int>(x.size()), s = static_cast<int>(c.size());
  Rows<double> out = Rows<double>::Ones(n, s);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < s; ++j)
      for (int k = 0; k < s; ++k)
        if (k != j) out(i, j) *= (x[i] - c[k]) / (c[j] - c[k]);
  return out;
}

}  // namespace

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
      G_(static_cast<size_t>(s.ng) * s.nv),
      gt_(s.ng),
      lam_(s.ng) {}

CollocationStep::~CollocationStep() = default;

void CollocationStep::residual(double t, const double* x, const double* dx, const double* z, double* R, double* C) {
  const std::vector<int>& rows = s_.rows.in_use();
  const Constraints& constraints = s_.constraints;
  s_.manifold.integrate(y0_.data(), x, q_.data());
  for (int i = 0; i < nv_ + ns_; ++i) u_[i] = y0_[nq_ + i] + x[nv_ + i];
  const double *v = u_.data(), *q = q_.data();
  s_.mechanics.poses(q);
  s_.counts.G += s_.ng > 0;
  s_.constraints.value(s_.mechanics, q, rows, G_.data());
  double* rates = R + 2 * nv_;
  s_.torque(t, q, v, v + nv_, R + nv_, rates);
  s_.mechanics.inverse(q, v, dx + nv_, inertial_.data());
  std::copy(v, v + nv_, R);
  s_.manifold.tangent(x, R);
  std::fill(gt_.begin(), gt_.end(), 0.0);
  constraints.speed(t, gt_.data());
  for (int i = 0; i < nv_; ++i) R[nv_ + i] -= inertial_[i];
  for (size_t i = 0; i < rows.size(); ++i) {
    const double* G = &G_[static_cast<size_t>(rows[i]) * nv_];
    double rate = gt_[rows[i]];
    for (int c : constraints.rows[rows[i]].columns) R[nv_ + c] += z[i] * G[c], rate += G[c] * v[c];
    C[i] = -rate;
    rates[ns_] -= z[i] * gt_[rows[i]];
  }
  for (int i = 0; i < nv_; ++i) R[i] -= dx[i];
  for (int i = 2 * nv_; i < ny_; ++i) R[i] -= dx[i];
}

std::shared_ptr<const LinearizedStages> CollocationStep::linearize(double t, const double* x, const double* dx,
                                                                   const double* z) {
  auto out = std::make_shared<LinearizedStages>();
  const std::vector<int>& rows = s_.rows.in_use();
  s_.manifold.integrate(y0_.data(), x, q_.data());
  for (int i = 0; i < nv_ + ns_ + 1; ++i) u_[i] = y0_[nq_ + i] + x[nv_ + i];
  std::fill(lam_.begin(), lam_.end(), 0.0);
  for (size_t i = 0; i < rows.size(); ++i) lam_[rows[i]] = z[i];
  s_.slopes(t, q_.data(), u_.data(), dx + nv_, lam_.data(), out->slopes);
  s_.manifold.slopes(x, u_.data(), out->turning);
  return out;
}

std::vector<std::shared_ptr<const StageSolver>> CollocationStep::factorize(
    const Radau& a, const std::shared_ptr<const LinearizedStages>& slopes, double h) {
  std::vector<std::shared_ptr<const StageSolver>> out;
  for (const Mode& mode : a.modes) {
    s_.counts.factorizations += 1;
    out.push_back(stage_solver(slopes, h * mode.value));
  }
  return out;
}

std::vector<int> CollocationStep::unknowns() const { return s_.rows.in_use(); }

std::shared_ptr<const StageSolver> CollocationStep::stage_solver(const std::shared_ptr<const LinearizedStages>& slopes,
                                                                 Complex mu) const {
  return solver(slopes, nv_, mu);
}

void CollocationStep::all_multipliers(double, const double*, double* out) {
  s_.saddle.all_multipliers(lam_.data(), out);
}

bool CollocationStep::solve(const Radau& a, int patience, double t, StageMemory& m) {
  const int s = a.s, r = static_cast<int>(m.unknowns.size()), measured = s_.measured();
  const double h = m.h;
  RowsOut K(m.K.data(), s, ny_), Z(m.Z.data(), s, r);
  const RowsIn A(a.A.data(), s, s);
  Rows<double> X = h * (A * K), R(s, ny_), C(s, r), dK(s, ny_), dZ(s, r);
  Vector<double> scale = In(size_.data(), measured) + X.leftCols(measured).cwiseAbs().colwise().maxCoeff().transpose();
  scale.array() += a.share * (measured ? scale.maxCoeff() : 0) + std::numeric_limits<double>::min();
  double last = 0, rate = 0;
  for (int k = 0; k < patience; ++k) {
    for (int i = 0; i < s; ++i)
      residual(t + a.c[i] * h, X.row(i).data(), K.row(i).data(), Z.row(i).data(), R.row(i).data(), C.row(i).data());
    dK.setZero(), dZ.setZero();
    for (size_t i = 0; i < a.modes.size(); ++i) {
      const Mode& mode = a.modes[i];
      Vector<Complex> dk = Vector<Complex>::Zero(ny_), dz = Vector<Complex>::Zero(r);
      for (int j = 0; j < s; ++j)
        dk += mode.row[j] * R.row(j).transpose().cast<Complex>(),
            dz += mode.row[j] * C.row(j).transpose().cast<Complex>();
      s_.counts.solves += 1;
      m.solvers[i]->solve(dk, dz);
      for (int j = 0; j < s; ++j) {
        const Complex w = mode.column[j];
        dK.row(j) += (w.real() * dk.real() - w.imag() * dk.imag()).transpose();
        dZ.row(j) += (w.real() * dz.real() - w.imag() * dz.imag()).transpose();
      }
    }
    K += dK, Z += dZ;
    X = h * (A * K);
    const Rows<double> move = h * (A * dK).leftCols(measured);
    const double size =
        std::sqrt((move.array().rowwise() / scale.transpose().array()).square().sum() / (s * measured));
    s_.counts.newton += 1;
    if (k) rate = k == 1 ? size / last : std::sqrt(rate * size / last);
    const bool converged = size <= a.tolerance || (k && size <= a.soon && rate < 1 &&
                                                   rate * size <= (1 - rate) * a.tolerance);
    if (converged || (k && size <= a.stalled && (size >= a.slower * last || k == patience - 1))) {
      m.rate = rate;
      return true;
    }
    if (!std::isfinite(size) || rate >= 1 || std::pow(rate, patience - 1 - k) * size > a.stalled) return false;
    last = size;
  }
  return false;
}

void CollocationStep::take(const Radau& a, bool controlled, double t, double h, const State& in, State& out,
                           double* z, Numbers& errors) {
  const int s = a.s, patience = controlled ? a.short_patience : a.patience;
  y0_ = in.y;
  const double* y = y0_.data();
  IndependentRows& rows = s_.rows;
  if (s_.ng && !rows.held) {
    if (!s_.point.near(y)) s_.point.evaluate(y, true);
    rows.choose_with_reason(s_.point.Z.data());
  }
  open(y);
  auto m = std::make_shared<StageMemory>();
  m->unknowns = unknowns();
  const int r = static_cast<int>(m->unknowns.size()), used = static_cast<int>(rows.in_use().size());
  s_.size(y, size_.data());
  const RowsIn A(a.A.data(), s, s);
  m->h = h, m->K.resize(static_cast<size_t>(s) * ny_), m->Z.resize(s * r);
  RowsOut K(m->K.data(), s, ny_), Z(m->Z.data(), s, r);
  Vector<double> F(ny_), middle = Vector<double>::Zero(ny_);
  const StageMemory* before = in.memory.get();
  if (before && (before->unknowns != m->unknowns || before->K.size() != m->K.size())) before = nullptr;
  if (before) {
    const RowsIn K0(before->K.data(), s, ny_), Z0(before->Z.data(), s, r);
    F.head(nv_) = In(y + nq_, nv_), F.tail(ny_ - nv_) = K0.row(s - 1).tail(ny_ - nv_).transpose();
    Numbers x(a.c);
    for (double& c : x) c = 1 + c * h / before->h;
    const Rows<double> onward = lagrange(a.c, x);
    K = onward * K0, Z = onward * Z0;
    middle = h * (A.row(a.middle) * K).transpose();
  } else {
    Numbers lam(s_.ng);
    s_.derivative(t, y, F.data(), lam.data());
    for (int i = 0; i < s; ++i) {
      K.row(i) = F.transpose();
      for (int j = 0; j < used; ++j) Z(i, j) = s_.multipliers()[m->unknowns[j]];
    }
  }
  bool found = false;
  if (before && before->rate < a.reuse) {
    const Numbers K1(m->K), Z1(m->Z);
    try {
      m->slopes = before->slopes, m->solvers = h == before->h ? before->solvers : factorize(a, m->slopes, h);
      found = solve(a, patience, t, *m);
    } catch (const Interrupted&) {
      throw;
    } catch (const Trouble&) {
    }
    if (!found) m->K = K1, m->Z = Z1;
  }
  if (!found) {
    RowsOut K2(m->K.data(), s, ny_), Z2(m->Z.data(), s, r);
    m->slopes = linearize(t, middle.data(), K2.row(a.middle).data(), Z2.row(a.middle).data());
    m->solvers = factorize(a, m->slopes, h);
    if (!solve(a, patience, t, *m)) throw Trouble();
  }
  const RowsIn K3(m->K.data(), s, ny_), Z3(m->Z.data(), s, r);
  Vector<double> x = h * (A.row(s - 1) * K3).transpose();
  if (!in.low.empty()) x += In(in.low.data(), ny_);
  out.y.resize(s_.length), out.low.assign(ny_, 0.0), out.carry.clear(), out.memory = m;
  s_.manifold.within(x.data());
  s_.add(y, x.data(), out.y.data());
  for (int k = s_.manifold.flat ? 0 : nv_; k < ny_; ++k) {
    const int i = k < nv_ ? k : k - nv_ + nq_;
    out.low[k] = x[k] - (out.y[i] - y[i]);
  }
  s_.point.evaluate(out.y.data(), true);
  Vector<double> R(ny_), C(r);
  CollocationStep::residual(t + h, x.data(), K3.row(s - 1).data(), Z3.row(s - 1).data(), R.data(), C.data());
  std::fill(lam_.begin(), lam_.end(), 0.0);
  for (int i = 0; i < used; ++i) lam_[m->unknowns[i]] = Z3(s - 1, i);
  if (used) {
    s_.saddle.symmetric();
    s_.saddle.balance(R.data() + nv_, lam_.data());
  }
  all_multipliers(t + h, Z3.row(s - 1).data(), z);
  errors.clear();
  if (controlled) {
    std::shared_ptr<const StageSolver> filtered;
    if (a.real < 0)
      s_.counts.factorizations += 1, filtered = stage_solver(m->slopes, h * a.gamma);
    else
      filtered = m->solvers[a.real];
    const RowsIn M(m->slopes->slopes.M.data(), nv_, nv_), start(a.start.data(), a.errors, s);
    for (int i = 0; i < a.errors; ++i) {
      Vector<double> miss = h * a.gamma * (F - (start.row(i) * K3).transpose());
      miss.segment(nv_, nv_) = (M * miss.segment(nv_, nv_)).eval();
      Vector<Complex> e = miss.cast<Complex>(), none = Vector<Complex>::Zero(r);
      s_.counts.solves += 1;
      filtered->solve(e, none);
      for (int k = 0; k < ny_; ++k) errors.push_back(e[k].real());
    }
  }
  if (!finite(out.y.data(), s_.length) || !finite(z, s_.nz)) throw Trouble();
}

}  // namespace mbdae
