// Exact first derivatives of a mechanism's equations (mbdae/mechanism/formulations/derivatives.py).
#include <algorithm>

#include "system/index2.hpp"
#include "mechanism/pair_slopes.hpp"
#include "numbers/vec3.hpp"

namespace mbdae {

void Index2System::slopes(double t, const double* q, const double* u, const double* vdot, const double* lam,
                          Slopes& out, std::vector<ActingWrench>* wrenches) {
  const size_t n = nv + ns + 1, m = nv, width = 2 * m + ns, r = rows.in_use().size();
  const double *v = u, *s = u + nv;
  counts.M += 1, counts.G += ng > 0;
  out.M.resize(m * m), by_q_.resize(m * m), by_v_.resize(m * m);
  mechanics.slopes(q, v, vdot, out.M.data(), by_q_.data(), by_v_.data());

  law_slopes_.resize((2 * m + ns) * width + ns + 1 + ng * m);
  double *conservative = law_slopes_.data(), *other = conservative + m * width, *rates = other + m * width;
  double *now = rates + ns * width, *G = now + ns + 1;
  torque(t, q, v, s, f_.data(), now);
  out.K.resize(n * m), out.D.assign(n * n, 0.0);
  double *powers = &out.K[(n - 1) * m], *powers_by_u = &out.D[(n - 1) * n];
  std::fill(out.K.begin() + m * m, out.K.end(), 0.0);
  for (size_t i = 0; i < m; ++i) {
    const double *q_ = &by_q_[i * m], *v_ = &by_v_[i * m];
    double *K = &out.K[i * m], *D = &out.D[i * n];
    for (size_t j = 0; j < m; ++j) K[j] = -q_[j], D[j] = -v_[j];
    powers_by_u[i] = other_[i];
  }
  if (!laws_.empty()) {
    std::fill(conservative, now, 0.0);
    for (const Law& law : laws_)
      law.kind->slopes(law, {mechanics, t, q, v, s + law.state},
                       {conservative, other, rates + law.state * width, width, 2 * nv + law.state, wrenches});
  }
  for (size_t i = 0; i < m && !laws_.empty(); ++i) {
    const double *a = conservative + i * width, *b = other + i * width;
    double *K = &out.K[i * m], *D = &out.D[i * n];
    for (size_t j = 0; j < m; ++j) K[j] += a[j] + b[j], powers[j] += v[i] * b[j];
    for (size_t j = 0; j < m + ns; ++j) D[j] += a[m + j] + b[m + j], powers_by_u[j] += v[i] * b[m + j];
  }
  for (int i = 0; i < ns; ++i) {
    const double* rate = rates + i * width;
    std::copy(rate, rate + m, &out.K[(m + i) * m]), std::copy(rate + m, rate + width, &out.D[(m + i) * n]);
  }

  const std::vector<int>& position = rows.position();
  out.G.assign(r * m, 0.0), out.g_t.assign(r, 0.0);
  std::fill(gt_.begin(), gt_.end(), 0.0);
  constraints.value(mechanics, q, rows.in_use(), G);
  constraints.speed(t, gt_.data());
  closure_slopes(q, v, lam, out.K.data(), out.B, wrenches);
  out.friction.clear();
  if (sliding) {  // its slopes by q and v are left out: Newton's iterations find what they miss
    constraints.value(mechanics, q, rows.others(), G);
    sliding.slips(v), sliding.slopes(G, lam, out.friction);
  }
  for (int k : rows.in_use()) {
    for (int c : constraints.rows[k].columns) out.G[position[k] * m + c] = G[k * m + c];
    out.g_t[position[k]] = gt_[k];
  }
}

void Index2System::closure_slopes(const double* q, const double* v, const double* lam, double* K, Numbers& B,
                                  std::vector<ActingWrench>* wrenches) const {
  const size_t m = nv, r = rows.in_use().size();
  const std::vector<int>& position = rows.position();
  B.assign(r * m, 0.0);
  for (size_t p = 0; p < constraints.pairs.size(); ++p) {
    const std::vector<int>& own = constraints.of_pair[p];
    if (std::none_of(own.begin(), own.end(), [&](int k) { return position[k] >= 0; })) continue;
    const PairSlopes here(mechanics, constraints.pairs[p], v);
    Turning sum;
    for (int k : own) {
      if (position[k] < 0) continue;
      Turning one;
      constraints.rows[k].slopes(here.pair, one);
      here.power(one.F, one, &B[position[k] * m]);
      if (!lam) continue;
      for (int i = 0; i < 6; ++i) sum.F[i] += lam[k] * one.F[i];
      for (int i = 0; i < 36; ++i) sum.Da[i] += lam[k] * one.Da[i], sum.Db[i] += lam[k] * one.Db[i];
    }
    if (!lam) continue;
    here.torque(sum, K, m);
    if (wrenches) wrenches->push_back({&here.pair, sum, true});
  }
  Numbers none(lam ? 0 : m * m);
  for (int k : rows.in_use())
    if (constraints.rows[k].between_joints())
      constraints.rows[k].coordinate_slopes(q, v, lam ? lam[k] : 0, lam ? K : none.data(), &B[position[k] * m], m);
}

}  // namespace mbdae
