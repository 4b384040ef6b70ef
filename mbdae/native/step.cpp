// Steps: the manifold, stages, whole steps, and the projection of their ends.
#include <algorithm>
#include <cmath>

#include "core.hpp"
#include "small.hpp"

namespace mbdae {

namespace {

constexpr double LARGEST_TURN = 3.0;  // rad within one step (mbdae/mechanism/manifold.py)
constexpr double TRUNCATION = 1e-7, ROUNDING = 1e-14, OPEN = 1e-9, STALLED = 1e-9;  // mbdae/mechanism/project.py
constexpr int ITERATIONS = 10;

}  // namespace

// -- the manifold -----------------------------------------------------------------------------------------------------

void Core::integrate(const double* q, const double* x, double* out) {
  if (!flat_) return m.integrate(q, x, out);
  for (int i = 0; i < nq; ++i) out[i] = q[i] + x[i];
}

void Core::within(const double* x) const {
  for (const Block& b : blocks_) {
    const double turn =
        b.kind == Block::se2 ? std::fabs(x[b.at + 2]) : norm(x + b.at + (b.kind == Block::se3 ? 3 : 0), 3);
    if (turn > LARGEST_TURN) throw Trouble();
  }
}

void Core::tangent(const double* x, double* dx) const {  // dx: v becomes J(x) v
  if (blocks_.empty()) return;
  within(x);
  for (const Block& b : blocks_) {
    const double* p = x + b.at;
    double ad[36] = {0}, out[6];
    int n = 3;
    auto skew = [&](const double* w, int row, int column, int width) {
      ad[row * width + column + 1] = -w[2], ad[row * width + column + 2] = w[1];
      ad[(row + 1) * width + column] = w[2], ad[(row + 1) * width + column + 2] = -w[0];
      ad[(row + 2) * width + column] = -w[1], ad[(row + 2) * width + column + 1] = w[0];
    };
    if (b.kind == Block::so3) {
      skew(p, 0, 0, 3);
    } else if (b.kind == Block::se3) {
      n = 6, skew(p + 3, 0, 0, 6), skew(p, 0, 3, 6), skew(p + 3, 3, 3, 6);
    } else {
      ad[1] = -p[2], ad[2] = p[1], ad[3] = p[2], ad[5] = -p[0];
    }
    inverse_jacobian(n, ad, dx + b.at, out);
    std::copy(out, out + n, dx + b.at);
  }
}

void Core::add(const double* y, const double* x, double* out) {
  integrate(y, x, out);
  for (int i = 0; i < nv + ns + 1; ++i) out[nq + i] = y[nq + i] + x[nv + i];
}

void Core::difference(const double* y0, const double* y1, double* out) {
  if (flat_)
    for (int i = 0; i < nv; ++i) out[i] = y1[i] - y0[i];
  else
    m.difference(y0, y1, out);
  for (int i = 0; i < nv + ns + 1; ++i) out[nv + i] = y1[nq + i] - y0[nq + i];
}

void Core::size(const double* y, double* out) {
  if (flat_)
    for (int i = 0; i < nv; ++i) out[i] = std::fabs(y[i]);
  else {
    m.difference(neutral_.data(), y, out);
    for (int i = 0; i < nv; ++i) out[i] = turning_[i] ? 1.0 : std::fabs(out[i]);
  }
  for (int i = 0; i < nv + ns + 1; ++i) out[nv + i] = std::fabs(y[nq + i]);
  if (constraints.drivers.empty()) return;
  m.inertia(y);  // the kinetic energy
  const double *M = m.M(), *v = y + nq;
  for (int k = 0; k < nv; ++k) {
    const double* c = M + static_cast<size_t>(k) * nv;
    double s = 0.5 * c[k] * v[k];
    for (int i : m.ancestors[k]) s += c[i] * v[i];
    out[ny - 1] += s * v[k];
  }
}

// -- a step -----------------------------------------------------------------------------------------------------------

void Core::stage(double t, const double* x, double that, const double* xhat, double factor, double* F, double* lam,
                 bool last) {
  integrate(q0_.data(), x, q_.data());
  for (int i = 0; i < nv; ++i) v_[i] = v0_[i] + x[nv + i];
  for (int i = 0; i < ns; ++i) s_[i] = s0_[i] + x[2 * nv + i];
  inertia(q_.data());
  counts.M += 1, counts.factorizations += 1;
  const std::vector<int>& which = last && !dropped_.empty() ? all_ : rows_;
  if (ng) counts.G += 2;
  constraints.value(m, q_.data(), which, G_.data(), g_.data());
  double* rates = F + 2 * nv;
  forces(t, q_.data(), v_.data(), s_.data(), f_.data(), rates);
  std::copy(v_.begin(), v_.end(), F);
  tangent(x, F);
  if (!rows_.empty()) {
    for (int i = 0; i < nv; ++i) dx_[i] = xhat[i] + factor * F[i];
    integrate(q0_.data(), dx_.data(), qhat_.data());
    m.poses(qhat_.data());
    constraints.value(m, qhat_.data(), rows_, Ghat_.data());
    if (!constraints.drivers.empty()) constraints.speed(that, gthat_.data()), constraints.speed(t, gt_.data());
    for (int k : which) {
      const size_t at = static_cast<size_t>(k) * nv;
      const std::vector<int>& columns = constraints.rows[k].columns;
      for (int c : columns) Z_[at + c] = G_[at + c];
      half(&Z_[at], columns);
    }
    for (int k : rows_) {
      const size_t at = static_cast<size_t>(k) * nv;
      const std::vector<int>& columns = constraints.rows[k].columns;
      double s = gthat_[k];
      for (int c : columns) {
        Zhat_[at + c] = Ghat_[at + c];
        s += Ghat_[at + c] * (v0_[c] + xhat[nv + c]);
      }
      half(&Zhat_[at], columns);
      lam[k] = -s / factor;
    }
  }
  solve(Zhat_.data(), lam, f_.data());
  for (int k : rows_) rates[ns] -= lam[k] * gt_[k];
  std::copy(f_.begin(), f_.end(), F + nv);
  if (last) {
    std::copy(q_.begin(), q_.end(), last_q_.begin());
    stands_ = true;
  }
}

void Core::step(const Tableau& a, double t, double h, const State& in, State& out, double* z, Numbers& errors) {
  const int n = a.n;
  const double* y = in.y.data();
  std::copy(y, y + nq, q0_.begin()), std::copy(y + nq, y + nq + nv, v0_.begin());
  std::copy(y + nq + nv, y + nq + nv + ns, s0_.begin());
  if (ng && !held_) {
    if (!at_last(q0_.data())) evaluate(q0_.data(), true);
    choose();
  }
  const int stride = stride_;  // ny and some zeros: loops without remainders
  if (F_.size() < static_cast<size_t>(n) * stride) F_.assign(static_cast<size_t>(n) * stride, 0.0);
  double* F = F_.data();
  if (a.first) std::copy(v0_.begin(), v0_.end(), F), std::copy(in.carry.begin(), in.carry.end(), F + nv);
  auto combine = [=](const double* w, int count, double* __restrict x) {
    for (int k = 0; k < stride; ++k) x[k] = 0;
    for (int j = 0; j < count; ++j) {
      const double f = w[j];
      if (f == 0) continue;
      const double* __restrict from = F + static_cast<size_t>(j) * stride;
      for (int k = 0; k < stride; k += 4)
        x[k] += f * from[k], x[k + 1] += f * from[k + 1], x[k + 2] += f * from[k + 2], x[k + 3] += f * from[k + 3];
    }
    for (int k = 0; k < stride; ++k) x[k] *= h;
  };
  for (int i = a.first; i < n; ++i) {
    combine(&a.A[i * n], i, x_.data()), combine(&a.Ahat[i * n], i, xhat_.data());
    stage(t + a.c[i] * h, x_.data(), t + a.chat[i] * h, xhat_.data(), h * a.Ahat[i * n + i],
          F + static_cast<size_t>(i) * stride, lam_.data(), i == n - 1);
  }
  combine(a.b.data(), n, x_.data());
  if (!in.low.empty())
    for (int k = 0; k < ny; ++k) x_[k] += in.low[k];
  within(x_.data());
  out.y.resize(length), out.low.assign(ny, 0.0);
  add(y, x_.data(), out.y.data());
  const int skip = flat_ ? 0 : nv;
  for (int k = skip; k < ny; ++k) {
    const int i = k < nv ? k : k - nv + nq;
    out.low[k] = x_[k] - (out.y[i] - y[i]);
  }
  if (a.first)
    out.carry.assign(F + static_cast<size_t>(n - 1) * stride + nv, F + static_cast<size_t>(n - 1) * stride + ny);
  const bool dependent = !dropped_.empty() && !rows_.empty();
  if (!rows_.empty() && (a.project || dependent)) symmetric();
  errors.resize(static_cast<size_t>(a.errors) * ny);
  for (int e = 0; e < a.errors; ++e) {
    double* x = &errors[static_cast<size_t>(e) * ny];
    combine(&a.e[e * n], n, xhat_.data());
    std::copy_n(xhat_.data(), ny, x);
    if (!a.project || rows_.empty()) continue;
    counts.projections += 1;
    for (int k : rows_) {
      lam_work_[k] = 0;
      for (int c : constraints.rows[k].columns) lam_work_[k] += G_[static_cast<size_t>(k) * nv + c] * x[nv + c];
    }
    normal(lam_work_, f_.data());
    for (int i = 0; i < nv; ++i) x[nv + i] -= f_[i];
  }
  own(lam_.data(), z);
  if (large_ && dependent) probe();
}

void Core::controlled(const Tableau& a, double t, double h, const State& in, State& out, double* z, Numbers& errors) {
  if (!a.doubled) return step(a, t, h, in, out, z, errors);
  State full, middle;
  Numbers none;
  step(a, t, h, in, full, z, none);
  step(a, t, h / 2, in, middle, z, none);
  step(a, t + h / 2, h / 2, middle, out, z, none);
  errors.resize(ny);
  difference(full.y.data(), out.y.data(), errors.data());
  for (double& e : errors) e /= std::pow(2.0, a.doubled) - 1;
}

void Core::derivative(double t, const double* y, double* F, double* z) {
  const double *q = y, *v = y + nq;
  if (stands_ && std::equal(q, q + nq, last_q_.begin()))
    m.inertia(q), counts.M += 1, counts.factorizations += 1, counts.G += ng > 0;  // poses and J
  else
    evaluate(q, true);
  double* rates = F + 2 * nv;
  forces(t, q, v, v + nv, f_.data(), rates);
  if (ng) {
    if (!held_ && (!large_ || fallen())) choose_all();
    m.motions(q, v);
    std::fill(gt_.begin(), gt_.end(), 0.0);
    constraints.acceleration(t, gt_.data());
    Numbers gamma(ng);
    constraints.bias(m, q, v, rows_, gamma.data());
    for (int k : rows_) lam_[k] = -(gamma[k] + gt_[k]);
    std::fill(gt_.begin(), gt_.end(), 0.0);
    constraints.speed(t, gt_.data());
  }
  solve(Z_.data(), lam_.data(), f_.data());
  for (int k : rows_) rates[ns] -= lam_[k] * gt_[k];
  std::copy(v, v + nv, F), std::copy(f_.begin(), f_.end(), F + nv);
  own(lam_.data(), z);
}

// -- projection (mbdae/mechanism/project.py) --------------------------------------------------------------------------

void Core::smallest(const double* r, double* x) {
  least(nv, ng, Z_.data(), r, TRUNCATION, x);
  back(x);
}

void Core::restore(double t, double* y) {
  if (!ng) return;
  double *q = y, *v = y + nq;
  if (!at_last(q)) evaluate(q, true);
  counts.state_projections += 1;
  Numbers g(g_), gap(ng), x(nv), nearer(nq);
  constraints.gaps(t, g.data());
  const bool stood = stands_;
  stands_ = false;
  double move = 0;
  bool moved = false;
  for (int i = 0; i < ITERATIONS; ++i) {
    if (norm(g.data(), ng) <= ROUNDING * (1 + largest(q, nq))) break;
    smallest(g.data(), x.data());
    move = largest(x.data(), nv);
    for (double& c : x) c = -c;
    integrate(q, x.data(), nearer.data());
    m.poses(nearer.data());
    counts.G += 1;
    constraints.value(m, nearer.data(), all_, Ghat_.data(), gap.data());
    constraints.gaps(t, gap.data());
    if (!(norm(gap.data(), ng) < 0.5 * norm(g.data(), ng))) break;
    std::copy(nearer.begin(), nearer.end(), q);
    g = gap, moved = true;
    std::swap(G_, Ghat_);
    std::copy(G_.begin(), G_.end(), Z_.begin());
    for (int k : all_) half(&Z_[static_cast<size_t>(k) * nv], constraints.rows[k].columns);
  }
  if (!(norm(g.data(), ng) <= OPEN) && !(move <= STALLED * (1 + largest(q, nq)))) throw Trouble();
  Numbers rate(ng, 0.0);
  constraints.speed(t, rate.data());
  for (int k = 0; k < ng; ++k) rate[k] += dot(&G_[static_cast<size_t>(k) * nv], v, nv);
  if (norm(rate.data(), ng) > ROUNDING * (1 + largest(v, nv))) {
    smallest(rate.data(), x.data());
    for (int i = 0; i < nv; ++i) v[i] -= x[i];
  }
  stands_ = stood && !moved;
  if (!finite(y, length)) throw Trouble();
}

}  // namespace mbdae
