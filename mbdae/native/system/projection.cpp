#include "system/projection.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// Scaled values: lengths in characteristic lengths of the mechanism.
Numbers scaled(const double* x, const std::vector<double>& scales) {
  Numbers out(scales.size());
  for (size_t i = 0; i < out.size(); ++i) out[i] = x[i] / scales[i];
  return out;
}

double norm_of(const double* x, const std::vector<double>& scales) {
  return norm(scaled(x, scales).data(), static_cast<int>(scales.size()));
}

}  // namespace

bool contradicts(const Index2System& s, double t, const double* v) {
  const Tolerances& limits = s.mechanics.limits;
  Numbers g_t(s.ng, 0.0);
  s.constraints.speed(t, g_t.data());
  if (largest(g_t.data(), s.ng) == 0) return false;
  double missed = 0, terms = 0;
  for (int k = 0; k < s.ng; ++k) {
    double sum = g_t[k], size = std::fabs(g_t[k]);
    const double* G = &s.point.G[static_cast<size_t>(k) * s.nv];
    for (int i = 0; i < s.nv; ++i) sum += G[i] * v[i], size += std::fabs(G[i] * v[i]);
    missed = std::max(missed, std::fabs(sum) / limits.row_scales[k]), terms = std::max(terms, size / limits.row_scales[k]);
  }
  return !(missed <= limits.kept * terms);
}

void add_magnitude(const Index2System& s, const double* y, double* size) {
  const std::vector<double>& scales = s.mechanics.limits.coordinate_scales;
  const double speed = largest_scaled(y + s.nq, scales);
  for (int i = 0; i < s.nv; ++i) size[i] += scales[i], size[s.nv + i] += scales[i] * speed;
}

double largest_move(const Numbers& move, const Numbers& magnitude, int measured, double share, double nothing) {
  double most = 0;
  for (int k = 0; k < measured; ++k) most = std::max(most, std::fabs(move[k]) / (share * magnitude[k] + nothing));
  return most;
}

bool felt(const Index2System& s, const double* rate, const double* v) {
  const Tolerances& limits = s.mechanics.limits;
  return s.constraints.sticks ||
         norm_of(rate, limits.row_scales) > limits.rounding * largest_scaled(v, limits.coordinate_scales);
}

void restore(Index2System& s, double t, double* y, std::vector<Numbers>* path) {
  const int nq = s.nq, nv = s.nv, ng = s.ng;
  const Tolerances& limits = s.mechanics.limits;
  Configuration& point = s.point;
  if (!ng) return;
  double *q = y, *v = y + nq;
  if (!point.near(q)) point.evaluate(q, true);
  s.counts.state_projections += 1;
  Numbers g(point.g), gap(ng), x(nv), nearer(nq), G(point.G.size());
  s.constraints.gaps(t, g.data());
  auto smallest = [&](const Numbers& Z, const Numbers& r) {  // x of least |x| in the mass metric with G x = r
    Numbers rows(Z);
    for (int k = 0; k < ng; ++k)
      for (int i = 0; i < nv; ++i) rows[static_cast<size_t>(k) * nv + i] /= limits.row_scales[k];
    least(nv, ng, rows.data(), scaled(r.data(), limits.row_scales).data(), limits.truncation, x.data());
    point.back(x.data());
  };
  Numbers kept;
  auto positional = [&]() -> const Numbers& {  // velocity rows do not constrain q
    kept = point.Z;
    for (int k : s.constraints.all)
      if (!s.constraints.rows[k].positional) std::fill_n(&kept[static_cast<size_t>(k) * nv], nv, 0.0);
    return kept;
  };
  double move = 0;
  for (int i = 0; i < limits.iterations; ++i) {
    if (norm_of(g.data(), limits.row_scales) <= limits.rounding * (1 + largest_scaled(q, limits.q_scales))) break;
    smallest(positional(), g);
    move = largest_scaled(x.data(), limits.coordinate_scales);
    for (double& c : x) c = -c;
    s.manifold.integrate(q, x.data(), nearer.data());
    s.mechanics.poses(nearer.data());
    s.counts.G += 1;
    s.constraints.value(s.mechanics, nearer.data(), s.constraints.all, G.data(), gap.data());
    s.constraints.gaps(t, gap.data());
    if (!(norm_of(gap.data(), limits.row_scales) < limits.falling * norm_of(g.data(), limits.row_scales))) break;
    if (path) path->emplace_back(q, q + nq);
    std::copy(nearer.begin(), nearer.end(), q);
    g = gap;
    point.forget();  // M remains that of the start
    std::swap(point.G, G);
    for (int k : s.constraints.all) point.scale(k);
  }
  if (!(norm_of(g.data(), limits.row_scales) <= limits.open) &&
      !(move <= limits.stalled * (1 + largest_scaled(q, limits.q_scales))))
    throw FallBackToPython();
  Numbers rate(ng, 0.0);
  s.constraints.speed(t, rate.data());
  for (int k = 0; k < ng; ++k) rate[k] += dot(&point.G[static_cast<size_t>(k) * nv], v, nv);
  if (felt(s, rate.data(), v)) {
    smallest(point.Z, rate);
    for (int i = 0; i < nv; ++i) v[i] -= x[i];
    if (contradicts(s, t, v)) throw FallBackToPython();
  }
  if (!finite(y, s.length)) throw FallBackToPython();
}

}  // namespace mbdae
