#include "system/projection.hpp"

#include <algorithm>
#include <cmath>

#include "numbers/vec3.hpp"

namespace mbdae {

bool felt(const Index2System& s, const double* rate, const double* v) {
  return s.constraints.sticks || norm(rate, s.ng) > s.mechanics.limits.rounding * (1 + largest(v, s.nv));
}

void restore(Index2System& s, double t, double* y, std::vector<Numbers>* path) {
  const int nq = s.nq, nv = s.nv, ng = s.ng;
  const Limits& limits = s.mechanics.limits;
  Point& point = s.point;
  if (!ng) return;
  double *q = y, *v = y + nq;
  if (!point.near(q)) point.evaluate(q, true);
  s.counts.state_projections += 1;
  Numbers g(point.g), gap(ng), x(nv), nearer(nq), G(point.G.size());
  s.constraints.gaps(t, g.data());
  auto smallest = [&](const Numbers& Z, const Numbers& r) {  // x of least |x| in the mass metric with G x = r
    least(nv, ng, Z.data(), r.data(), limits.truncation, x.data());
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
    if (norm(g.data(), ng) <= limits.rounding * (1 + largest(q, nq))) break;
    smallest(positional(), g);
    move = largest(x.data(), nv);
    for (double& c : x) c = -c;
    s.manifold.integrate(q, x.data(), nearer.data());
    s.mechanics.poses(nearer.data());
    s.counts.G += 1;
    s.constraints.value(s.mechanics, nearer.data(), s.constraints.all, G.data(), gap.data());
    s.constraints.gaps(t, gap.data());
    if (!(norm(gap.data(), ng) < limits.falling * norm(g.data(), ng))) break;
    if (path) path->emplace_back(q, q + nq);
    std::copy(nearer.begin(), nearer.end(), q);
    g = gap;
    point.forget();  // M stays that of the start
    std::swap(point.G, G);
    for (int k : s.constraints.all) point.scale(k);
  }
  if (!(norm(g.data(), ng) <= limits.open) && !(move <= limits.stalled * (1 + largest(q, nq)))) throw Trouble();
  Numbers rate(ng, 0.0);
  s.constraints.speed(t, rate.data());
  for (int k = 0; k < ng; ++k) rate[k] += dot(&point.G[static_cast<size_t>(k) * nv], v, nv);
  if (felt(s, rate.data(), v)) {
    smallest(point.Z, rate);
    for (int i = 0; i < nv; ++i) v[i] -= x[i];
  }
  if (!finite(y, s.length)) throw Trouble();
}

}  // namespace mbdae
