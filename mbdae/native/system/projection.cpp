#include "system/projection.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// Numbers by their scales: lengths in characteristic lengths of the mechanism.
Numbers scaled(const double* x, const std::vector<double>& scales) {
  Numbers out(scales.size());
  for (size_t i = 0; i < out.size(); ++i) out[i] = x[i] / scales[i];
  return out;
}

double norm_of(const double* x, const std::vector<double>& scales) {
  return norm(scaled(x, scales).data(), static_cast<int>(scales.size()));
}

double largest_of(const double* x, const std::vector<double>& scales) {
  return largest(scaled(x, scales).data(), static_cast<int>(scales.size()));
}

}  // namespace

bool felt(const Index2System& s, const double* rate, const double* v) {
  const Tolerances& limits = s.mechanics.limits;
  return s.constraints.sticks ||
         norm_of(rate, limits.row_scales) > limits.rounding * largest_of(v, limits.coordinate_scales);
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
  auto positional = [&]() -> const Numbers& {  // rows of velocity have no part in q
    kept = point.Z;
    for (int k : s.constraints.all)
      if (!s.constraints.rows[k].positional) std::fill_n(&kept[static_cast<size_t>(k) * nv], nv, 0.0);
    return kept;
  };
  double move = 0;
  for (int i = 0; i < limits.iterations; ++i) {
    if (norm_of(g.data(), limits.row_scales) <= limits.rounding * (1 + largest_of(q, limits.q_scales))) break;
    smallest(positional(), g);
    move = largest_of(x.data(), limits.coordinate_scales);
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
    point.forget();  // M stays that of the start
    std::swap(point.G, G);
    for (int k : s.constraints.all) point.scale(k);
  }
  if (!(norm_of(g.data(), limits.row_scales) <= limits.open) &&
      !(move <= limits.stalled * (1 + largest_of(q, limits.q_scales))))
    throw FallBackToPython();
  Numbers rate(ng, 0.0);
  s.constraints.speed(t, rate.data());
  for (int k = 0; k < ng; ++k) rate[k] += dot(&point.G[static_cast<size_t>(k) * nv], v, nv);
  if (felt(s, rate.data(), v)) {
    smallest(point.Z, rate);
    for (int i = 0; i < nv; ++i) v[i] -= x[i];
  }
  if (!finite(y, s.length)) throw FallBackToPython();
}

}  // namespace mbdae
