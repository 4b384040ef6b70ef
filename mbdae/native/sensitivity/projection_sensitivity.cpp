#include "sensitivity/projection_sensitivity.hpp"

#include <algorithm>

#include "system/projection.hpp"
#include "math/vec3.hpp"

namespace mbdae {

ProjectionSensitivity::ProjectionSensitivity(Index2System& s, ParameterPartials& parameters, bool forward)
    : s_(s),
      parameters_(parameters),
      forward_(forward && parameters.count()),
      factors_(s.tree, s.constraints, s.counts) {}

void ProjectionSensitivity::take(double t, double* y, bool positions) {
  const int nq = s_.nq, nv = s_.nv, ng = s_.ng;
  count_ = 0;
  if (!ng) return;
  std::vector<Vector> path;
  const Vector v(y + nq, y + nq + nv);
  q0_.assign(y, y + nq);
  if (positions)
    project_state(s_, t, y, &path);
  else
    s_.point.evaluate(y, true);
  factors_.exchange(s_.point);
  s_.point.invalidate();
  Vector r(ng, 0.0);
  auto next = [&](const double* q, bool of_v) -> Correction& {
    if (count_ == corrections_.size()) corrections_.emplace_back(new Correction);
    Correction& c = *corrections_[count_++];
    c.of_v = of_v;
    s_.tree.poses(q);
    c.G.resize(s_.constraints.start.back()), c.Z.resize(c.G.size()), r.assign(ng, 0.0);
    s_.constraints.value(s_.tree, q, s_.constraints.all, c.G.data(), r.data());
    return c;
  };
  if (positions && path.empty()) path.push_back(q0_);  // even without a violation: perturbed states may violate the constraints
  for (const Vector& q : path) {
    Correction& c = next(q.data(), false);
    s_.constraints.complete_g(t, r.data());
    c.by_t.assign(ng, 0.0), s_.constraints.evaluate_g_t(t, c.by_t.data());
    correct(c, t, q.data(), nullptr, r);
  }
  Correction& c = next(y, true);
  std::fill(r.begin(), r.end(), 0.0);
  s_.constraints.evaluate_g_t(t, r.data());
  for (int k = 0; k < ng; ++k) r[k] += s_.constraints.times(k, c.G, v.data());
  c.by_t.assign(ng, 0.0), s_.constraints.evaluate_g_tt(t, c.by_t.data());
  correct(c, t, y, v.data(), r);
  for (int e = 0; e < nv && !positions; ++e) y[nq + e] -= c.x[e];
}

void ProjectionSensitivity::correct(Correction& c, double t, const double* q, const double* v, const Vector& r) {
  const int nv = s_.nv, nq = s_.nq;
  c.rows.clear();
  for (int k : s_.rows.in_use())
    if (c.of_v || s_.constraints.rows[k].positional) c.rows.push_back(k);
  const int n = static_cast<int>(c.rows.size());
  factors_.scale_rows(c.rows, c.G, c.Z);
  c.lu.resize(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) c.lu.at(i, j) = s_.constraints.product(c.rows[i], c.rows[j], c.Z.data());
  if (n && !c.lu.factorize()) throw FallBackToPython();
  Vector x(nv, 0.0), eta(r);
  solve(c, x.data(), eta.data());
  c.x = x;
  LinearizationPoint& p = c.point;
  p.loaded = false, p.t = t, p.q.assign(q, q + nq), p.u.assign(nv + s_.ns + 1, 0.0), p.vdot.assign(nv, 0.0);
  p.lam.assign(s_.ng, 0.0), p.wrenches.clear(), p.constraint_points.resize(1);
  LinearizationPoint::ConstraintPoint& constrained = p.constraint_points[0];
  constrained.t = t, constrained.q = p.q,
  constrained.kind = c.of_v ? LinearizationPoint::ConstraintPoint::rate : LinearizationPoint::ConstraintPoint::g,
  constrained.weight = 1;
  if (c.of_v) constrained.v.assign(v, v + nv);
  c.moved = largest(x.data(), nv) > s_.tree.limits.evaluation_rounding;
  const bool requested = parameters_.frames_move();
  if (c.of_v)
    s_.closure_partials(q, v, nullptr, nullptr, &c.Bv, nullptr, requested ? &constrained.wrench_partials : nullptr);
  if (!c.of_v) {
    Vector back(x);
    for (double& e : back) e = -e;
    s_.manifold.integrate_partials(back.data(), x.data(), c.integrate_partials);
  }
  p.at_rest = !c.moved;
  const size_t m = nv;
  if (c.moved) {
    p.vdot = x;
    for (int k : c.rows) p.lam[k] = eta[k];
    p.constraint_points.push_back({t, p.q, x, LinearizationPoint::ConstraintPoint::Gv, -1});
    c.K.assign(m * m, 0.0);
    s_.closure_partials(q, x.data(), p.lam.data(), c.K.data(), &c.B, requested ? &p.wrenches : nullptr,
                        requested ? &p.constraint_points[1].wrench_partials : nullptr);
  }
  if (forward_) {
    parameters_.rows(p, c.Q, p.q);
    if (c.moved) parameters_.forces(p, c.P);
  }
  if (!c.moved) return;
  const Vector zero(nv, 0.0);
  Vector by_v(m * m);
  c.T.resize(m * m);
  s_.tree.partials(q0_.data(), zero.data(), x.data(), c.T.data(), by_v.data(), true);
}

void ProjectionSensitivity::solve(const Correction& c, double* above, double* below) const {
  Vector l(c.rows.size());
  factors_.solve_root(above);
  for (size_t i = 0; i < l.size(); ++i) l[i] = below[c.rows[i]] - s_.constraints.times(c.rows[i], c.Z, above);
  c.lu.solve(l.data());
  for (size_t i = 0; i < l.size(); ++i)
    below[c.rows[i]] = l[i], s_.constraints.add(c.rows[i], c.Z, l[i], above);
  factors_.solve_root_transposed(above);
}

void ProjectionSensitivity::solve_transposed(const Correction& c, double* above, double* below) const {
  const std::vector<int>& position = s_.rows.position();
  Vector l(c.rows.size());
  factors_.solve_root(above);
  for (size_t j = 0; j < l.size(); ++j) l[j] = s_.constraints.times(c.rows[j], c.Z, above);
  c.lu.solve_transposed(l.data());
  for (size_t j = 0; j < l.size(); ++j)
    below[position[c.rows[j]]] = l[j], s_.constraints.add(c.rows[j], c.Z, -l[j], above);
  factors_.solve_root_transposed(above);
}

void ProjectionSensitivity::forward(int directions, double* moved, size_t width, const double* dp,
                                    const double* dt) {
  const int nv = s_.nv, ng = s_.ng;
  const std::vector<int>& position = s_.rows.position();
  const size_t r = s_.rows.in_use().size(), n = nv + s_.ns + 1, k = parameters_.count();
  Vector above(nv), below(ng), dq(nv), rotated(nv);
  for (int d = 0; d < directions; ++d) {
    double *dy = moved + d * width, *dv = dy + nv;
    const Vector dq0(dy, dy + nv);
    dq = dq0;
    for (size_t i = 0; i < count_; ++i) {
      const Correction& c = *corrections_[i];
      std::fill(above.begin(), above.end(), 0.0);
      if (c.moved) {
        add_times(c.T, nv, nv, dq0.data(), above.data());
        for (double& e : above) e = -e;
        add_times(c.K, nv, nv, dq.data(), above.data());
      }
      for (int row : c.rows) {
        const size_t at = static_cast<size_t>(position[row]) * nv;
        double s = s_.constraints.times(row, c.G, c.of_v ? dv : dq.data());
        if (c.of_v) s += dot(&c.Bv[at], dq.data(), nv);
        if (c.moved) s -= dot(&c.B[at], dq.data(), nv);
        below[row] = dt ? s + dt[d] * c.by_t[row] : s;
      }
      for (size_t l = 0; l < k; ++l) {
        const double w = dp[d * k + l];
        if (w == 0) continue;
        for (int e = 0; c.moved && e < nv; ++e) above[e] += w * c.P[l * n + e];
        for (int row : c.rows) below[row] += w * c.Q[l * r + position[row]];
      }
      solve(c, above.data(), below.data());
      if (c.of_v) {
        for (int e = 0; e < nv; ++e) dv[e] -= above[e];
        continue;
      }
      apply(c.integrate_partials, &IntegratePartialsBlock::A, false, true, nv, dq.data(), rotated.data()), dq = rotated;
      apply(c.integrate_partials, &IntegratePartialsBlock::R, false, true, nv, above.data(), rotated.data());
      for (int e = 0; e < nv; ++e) dq[e] -= rotated[e];
    }
    std::copy(dq.begin(), dq.end(), dy);
  }
}

void ProjectionSensitivity::reverse(int costs, double* bars, size_t width) {
  const int nv = s_.nv, n = nv + s_.ns + 1;
  const std::vector<int>& position = s_.rows.position();
  const size_t r = s_.rows.in_use().size();
  Vector mus(costs * static_cast<size_t>(n)), nus(costs * r), start(costs * static_cast<size_t>(nv), 0.0), rotated(nv);
  for (size_t i = count_; i-- > 0;) {
    const Correction& c = *corrections_[i];
    std::fill(mus.begin(), mus.end(), 0.0), std::fill(nus.begin(), nus.end(), 0.0);
    for (int d = 0; d < costs; ++d) {
      double *q = bars + d * width, *v = q + nv, *mu = &mus[d * static_cast<size_t>(n)], *nu = nus.data() + d * r;
      if (c.of_v) {
        for (int e = 0; e < nv; ++e) mu[e] = -v[e];
      } else {
        apply(c.integrate_partials, &IntegratePartialsBlock::R, true, true, nv, q, mu);
        for (int e = 0; e < nv; ++e) mu[e] = -mu[e];
        apply(c.integrate_partials, &IntegratePartialsBlock::A, true, true, nv, q, rotated.data());
        std::copy(rotated.begin(), rotated.end(), q);
      }
      solve_transposed(c, mu, nu);
      for (int row : c.rows) {
        const double w = nu[position[row]];
        s_.constraints.add(row, c.G, w, c.of_v ? v : q);
        const double* b = c.moved ? &c.B[static_cast<size_t>(position[row]) * nv] : nullptr;
        const double* bv = c.of_v ? &c.Bv[static_cast<size_t>(position[row]) * nv] : nullptr;
        for (int e = 0; e < nv; ++e) {
          if (bv) q[e] += w * bv[e];
          if (b) q[e] -= w * b[e];
        }
      }
      if (!c.moved) continue;
      add_transposed(c.K, nv, nv, mu, q);
      std::fill(rotated.begin(), rotated.end(), 0.0);
      add_transposed(c.T, nv, nv, mu, rotated.data());
      for (int e = 0; e < nv; ++e) start[d * static_cast<size_t>(nv) + e] -= rotated[e];
    }
    parameters_.add_point(c.point, mus, nus);
  }
  for (int d = 0; d < costs; ++d)
    for (int e = 0; e < nv; ++e) bars[d * width + e] += start[d * static_cast<size_t>(nv) + e];
}

}  // namespace mbdae
