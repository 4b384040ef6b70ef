// Corrections of a projection, recomputed, and their tangents and adjoints.
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
    project_state(s_, t, y, false, &path);
  else
    s_.point.evaluate(y, true);
  factors_.exchange(s_.point);
  s_.point.invalidate();
  Vector r(ng, 0.0);
  auto add_correction = [&](const double* q, bool velocity_level) -> Correction& {
    if (count_ == corrections_.size()) corrections_.emplace_back(new Correction);
    Correction& c = *corrections_[count_++];
    c.velocity_level = velocity_level;
    s_.tree.poses(q);
    c.G.resize(s_.constraints.start.back()), c.Z.resize(c.G.size()), r.assign(ng, 0.0);
    s_.constraints.value(s_.tree, q, s_.constraints.all, c.G.data(), r.data());
    return c;
  };
  // also without a violation: perturbed states may violate the constraints
  if (positions && path.empty()) path.push_back(q0_);
  for (const Vector& q : path) {
    Correction& c = add_correction(q.data(), false);
    s_.constraints.complete_g(t, r.data());
    c.dr_dt.assign(ng, 0.0), s_.constraints.evaluate_g_t(t, c.dr_dt.data());
    correct(c, t, q.data(), nullptr, r);
  }
  Correction& c = add_correction(y, true);
  std::fill(r.begin(), r.end(), 0.0);
  s_.constraints.evaluate_g_t(t, r.data());
  for (int k = 0; k < ng; ++k) r[k] += s_.constraints.times(k, c.G, v.data());
  c.dr_dt.assign(ng, 0.0), s_.constraints.evaluate_g_tt(t, c.dr_dt.data());
  correct(c, t, y, v.data(), r);
  for (int e = 0; e < nv && !positions; ++e) y[nq + e] -= c.x[e];
}

void ProjectionSensitivity::correct(Correction& c, double t, const double* q, const double* v, const Vector& r) {
  const int nv = s_.nv, nq = s_.nq;
  c.rows.clear();
  for (int k : s_.rows.in_use())
    if (c.velocity_level || s_.constraints.rows[k].positional) c.rows.push_back(k);
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
  p.has_applied_forces = false, p.t = t, p.q.assign(q, q + nq), p.u.assign(nv + s_.ns + 1, 0.0), p.vdot.assign(nv, 0.0);
  p.lam.assign(s_.ng, 0.0), p.wrenches.clear(), p.constraint_points.resize(1);
  LinearizationPoint::ConstraintPoint& constrained = p.constraint_points[0];
  constrained.t = t, constrained.q = p.q,
  constrained.kind =
      c.velocity_level ? LinearizationPoint::ConstraintPoint::rate : LinearizationPoint::ConstraintPoint::g,
  constrained.weight = 1;
  if (c.velocity_level) constrained.v.assign(v, v + nv);
  c.is_nonzero = largest(x.data(), nv) > s_.tree.tolerances.evaluation_rounding;
  const bool requested = parameters_.frames_move();
  if (c.velocity_level)
    s_.closure_partials(q, v, nullptr, nullptr, &c.Bv, nullptr, requested ? &constrained.wrench_partials : nullptr);
  if (!c.velocity_level) {
    Vector minus_x(x);
    for (double& e : minus_x) e = -e;
    s_.manifold.integrate_partials(minus_x.data(), x.data(), c.integrate_partials);
  }
  p.at_rest = !c.is_nonzero;
  const size_t m = nv;
  if (c.is_nonzero) {
    p.vdot = x;
    for (int k : c.rows) p.lam[k] = eta[k];
    p.constraint_points.push_back({t, p.q, x, LinearizationPoint::ConstraintPoint::Gv, -1});
    c.K.assign(m * m, 0.0);
    s_.closure_partials(q, x.data(), p.lam.data(), c.K.data(), &c.B, requested ? &p.wrenches : nullptr,
                        requested ? &p.constraint_points[1].wrench_partials : nullptr);
  }
  if (forward_) {
    parameters_.rows(p, c.Q, p.q);
    if (c.is_nonzero) parameters_.forces(p, c.P);
  }
  if (!c.is_nonzero) return;
  const Vector zero(nv, 0.0);
  Vector dtau_dv(m * m);
  c.T.resize(m * m);
  s_.tree.partials(q0_.data(), zero.data(), x.data(), c.T.data(), dtau_dv.data(), true);
}

void ProjectionSensitivity::solve(const Correction& c, double* upper, double* lower) const {
  Vector l(c.rows.size());
  factors_.solve_root(upper);
  for (size_t i = 0; i < l.size(); ++i) l[i] = lower[c.rows[i]] - s_.constraints.times(c.rows[i], c.Z, upper);
  c.lu.solve(l.data());
  for (size_t i = 0; i < l.size(); ++i) lower[c.rows[i]] = l[i], s_.constraints.add(c.rows[i], c.Z, l[i], upper);
  factors_.solve_root_transposed(upper);
}

void ProjectionSensitivity::solve_transposed(const Correction& c, double* upper, double* lower) const {
  const std::vector<int>& position = s_.rows.position();
  Vector l(c.rows.size());
  factors_.solve_root(upper);
  for (size_t j = 0; j < l.size(); ++j) l[j] = s_.constraints.times(c.rows[j], c.Z, upper);
  c.lu.solve_transposed(l.data());
  for (size_t j = 0; j < l.size(); ++j)
    lower[position[c.rows[j]]] = l[j], s_.constraints.add(c.rows[j], c.Z, -l[j], upper);
  factors_.solve_root_transposed(upper);
}

void ProjectionSensitivity::forward(int directions, double* tangents, size_t width, const double* dp,
                                    const double* dt) {
  const int nv = s_.nv, ng = s_.ng;
  const std::vector<int>& position = s_.rows.position();
  const size_t r = s_.rows.in_use().size(), n = nv + s_.ns + 1, k = parameters_.count();
  Vector upper(nv), lower(ng), dq(nv), rotated(nv);
  for (int d = 0; d < directions; ++d) {
    double *dy = tangents + d * width, *dv = dy + nv;
    const Vector dq0(dy, dy + nv);
    dq = dq0;
    for (size_t i = 0; i < count_; ++i) {
      const Correction& c = *corrections_[i];
      std::fill(upper.begin(), upper.end(), 0.0);
      if (c.is_nonzero) {
        add_times(c.T, nv, nv, dq0.data(), upper.data());
        for (double& e : upper) e = -e;
        add_times(c.K, nv, nv, dq.data(), upper.data());
      }
      for (int row : c.rows) {
        const size_t row_start = static_cast<size_t>(position[row]) * nv;
        double s = s_.constraints.times(row, c.G, c.velocity_level ? dv : dq.data());
        if (c.velocity_level) s += dot(&c.Bv[row_start], dq.data(), nv);
        if (c.is_nonzero) s -= dot(&c.B[row_start], dq.data(), nv);
        lower[row] = dt ? s + dt[d] * c.dr_dt[row] : s;
      }
      for (size_t l = 0; l < k; ++l) {
        const double w = dp[d * k + l];
        if (w == 0) continue;
        for (int e = 0; c.is_nonzero && e < nv; ++e) upper[e] += w * c.P[l * n + e];
        for (int row : c.rows) lower[row] += w * c.Q[l * r + position[row]];
      }
      solve(c, upper.data(), lower.data());
      if (c.velocity_level) {
        for (int e = 0; e < nv; ++e) dv[e] -= upper[e];
        continue;
      }
      apply(c.integrate_partials, &IntegratePartialsBlock::A, false, true, nv, dq.data(), rotated.data()), dq = rotated;
      apply(c.integrate_partials, &IntegratePartialsBlock::R, false, true, nv, upper.data(), rotated.data());
      for (int e = 0; e < nv; ++e) dq[e] -= rotated[e];
    }
    std::copy(dq.begin(), dq.end(), dy);
  }
}

void ProjectionSensitivity::reverse(int costs, double* cotangents, size_t width) {
  const int nv = s_.nv, n = nv + s_.ns + 1;
  const std::vector<int>& position = s_.rows.position();
  const size_t r = s_.rows.in_use().size();
  Vector force_cotangents(costs * static_cast<size_t>(n)), row_cotangents(costs * r),
      q0_cotangents(costs * static_cast<size_t>(nv), 0.0), rotated(nv);
  for (size_t i = count_; i-- > 0;) {
    const Correction& c = *corrections_[i];
    std::fill(force_cotangents.begin(), force_cotangents.end(), 0.0),
        std::fill(row_cotangents.begin(), row_cotangents.end(), 0.0);
    for (int d = 0; d < costs; ++d) {
      double *q = cotangents + d * width, *v = q + nv, *force_bar = &force_cotangents[d * static_cast<size_t>(n)],
             *row_bar = row_cotangents.data() + d * r;
      if (c.velocity_level) {
        for (int e = 0; e < nv; ++e) force_bar[e] = -v[e];
      } else {
        apply(c.integrate_partials, &IntegratePartialsBlock::R, true, true, nv, q, force_bar);
        for (int e = 0; e < nv; ++e) force_bar[e] = -force_bar[e];
        apply(c.integrate_partials, &IntegratePartialsBlock::A, true, true, nv, q, rotated.data());
        std::copy(rotated.begin(), rotated.end(), q);
      }
      solve_transposed(c, force_bar, row_bar);
      for (int row : c.rows) {
        const double w = row_bar[position[row]];
        s_.constraints.add(row, c.G, w, c.velocity_level ? v : q);
        const double* b = c.is_nonzero ? &c.B[static_cast<size_t>(position[row]) * nv] : nullptr;
        const double* bv = c.velocity_level ? &c.Bv[static_cast<size_t>(position[row]) * nv] : nullptr;
        for (int e = 0; e < nv; ++e) {
          if (bv) q[e] += w * bv[e];
          if (b) q[e] -= w * b[e];
        }
      }
      if (!c.is_nonzero) continue;
      add_transposed(c.K, nv, nv, force_bar, q);
      std::fill(rotated.begin(), rotated.end(), 0.0);
      add_transposed(c.T, nv, nv, force_bar, rotated.data());
      for (int e = 0; e < nv; ++e) q0_cotangents[d * static_cast<size_t>(nv) + e] -= rotated[e];
    }
    parameters_.add_point(c.point, force_cotangents, row_cotangents);
  }
  for (int d = 0; d < costs; ++d)
    for (int e = 0; e < nv; ++e) cotangents[d * width + e] += q0_cotangents[d * static_cast<size_t>(nv) + e];
}

}  // namespace mbdae
