// Exact partials of the equations of a mechanism (mbdae/mechanism/formulations/equation_partials.py).
#include <algorithm>

#include "system/index2.hpp"
#include "mechanism/wrench_partials.hpp"
#include "math/vec3.hpp"

namespace mbdae {

void Index2System::partials(double t, const double* q, const double* u, const double* vdot, const double* lam,
                          EquationPartials& out) {
  const size_t m = nv, r = rows.in_use().size();
  const std::vector<int>& position = rows.position();
  force_partials(t, q, u, vdot, lam, out, &out.B);
  out.M.resize(m * m), tree.dense_M(out.M.data());
  counts.M += 1, counts.G += ng > 0;
  out.G.assign(r * m, 0.0);
  constraints.dense_value(tree, q, rows.in_use(), all_G_);
  out.friction.clear();
  if (friction) {  // its d/d(q, v) are omitted, which only slows the convergence of Newton's method
    constraints.dense_value(tree, q, rows.remaining(), all_G_);
    friction.update_slips(u), friction.partials(all_G_.data(), lam, out.friction);
  }
  for (int k : rows.in_use())
    for (int c : constraints.rows[k].columns) out.G[position[k] * m + c] = all_G_[k * m + c];
}

void Index2System::force_partials(double t, const double* q, const double* u, const double* vdot, const double* lam,
                                  EquationPartials& out, Vector* B, std::vector<LawWrench>* wrenches) {
  const size_t n = nv + ns + 1, m = nv, width = 2 * m + ns;
  const double *v = u, *s = u + nv;
  dtau_dq_.resize(m * m), dtau_dv_.resize(m * m);
  tree.partials(q, v, vdot, dtau_dq_.data(), dtau_dv_.data());

  Vector state_rates(ns + 1);
  generalized_force(t, q, v, s, f_.data(), state_rates.data());
  out.K.resize(n * m), out.D.assign(n * n, 0.0);
  double *power_dq = &out.K[(n - 1) * m], *power_du = &out.D[(n - 1) * n];
  std::fill(out.K.begin() + m * m, out.K.end(), 0.0);
  for (size_t i = 0; i < m; ++i) {
    const double *q_ = &dtau_dq_[i * m], *v_ = &dtau_dv_[i * m];
    double *K = &out.K[i * m], *D = &out.D[i * n];
    for (size_t j = 0; j < m; ++j) K[j] = -q_[j], D[j] = -v_[j];
    power_du[i] = nonconservative_[i];
  }
  const double *conservative = law_partials(t, q, v, s, wrenches), *other = conservative + m * width,
               *rates = other + m * width;
  for (size_t i = 0; i < m && !laws_.empty(); ++i) {
    const double *a = conservative + i * width, *b = other + i * width;
    double *K = &out.K[i * m], *D = &out.D[i * n];
    for (size_t j = 0; j < m; ++j) K[j] += a[j] + b[j], power_dq[j] += v[i] * b[j];
    for (size_t j = 0; j < m + ns; ++j) D[j] += a[m + j] + b[m + j], power_du[j] += v[i] * b[m + j];
  }
  for (int i = 0; i < ns; ++i) {
    const double* rate = rates + i * width;
    std::copy(rate, rate + m, &out.K[(m + i) * m]), std::copy(rate + m, rate + width, &out.D[(m + i) * n]);
  }

  out.g_t.assign(rows.in_use().size(), 0.0);
  std::fill(gt_.begin(), gt_.end(), 0.0);
  constraints.evaluate_g_t(t, gt_.data());
  for (int k : rows.in_use()) out.g_t[rows.position()[k]] = gt_[k];
  closure_partials(q, v, lam, out.K.data(), B, wrenches);
}

const double* Index2System::law_partials(double t, const double* q, const double* v, const double* s,
                                         std::vector<LawWrench>* wrenches) {
  const size_t m = nv, width = 2 * m + ns;
  law_partials_.assign((2 * m + ns) * width, 0.0);
  double *conservative = law_partials_.data(), *other = conservative + m * width, *rates = other + m * width;
  for (const Law& law : laws_)
    law.kind->partials(law, {tree, t, q, v, s + law.state},
                       {conservative, other, rates + law.state * width, width, 2 * nv + law.state, wrenches});
  return conservative;
}

void Index2System::time_partials(double t, const double* q, const double* u, const double* lam, double* out) {
  const double *v = u, *s = u + nv;
  std::fill(nonconservative_.begin(), nonconservative_.end(), 0.0);
  std::fill(out, out + nv + ns + 1, 0.0), std::fill(gt_.begin(), gt_.end(), 0.0);
  for (const Law& law : laws_)
    if (law.kind->time_rate)
      law.kind->time_rate(law, {tree, t, q, v, s + law.state}, {out, nonconservative_.data(), out + nv + law.state});
  for (int i = 0; i < nv; ++i) out[i] += nonconservative_[i];
  constraints.evaluate_g_tt(t, gt_.data());
  out[nv + ns] = dot(nonconservative_.data(), v, nv) - dot(gt_.data(), lam, ng);
}

void Index2System::closure_partials(const double* q, const double* v, const double* lam, double* K, Vector* B,
                                    std::vector<LawWrench>* wrenches, std::vector<WrenchPartials>* wrench_partials,
                                    const IndependentRows* other_rows) {
  const size_t m = nv;
  const IndependentRows& selected = other_rows ? *other_rows : rows;
  const std::vector<int>& position = selected.position();
  if (B) B->assign(selected.in_use().size() * m, 0.0);
  if (wrench_partials) wrench_partials->resize(ng);
  for (size_t p = 0; p < constraints.pairs.size(); ++p) {
    const std::vector<int>& pair_rows = constraints.rows_of_pair[p];
    if (std::none_of(pair_rows.begin(), pair_rows.end(), [&](int k) { return position[k] >= 0; })) continue;
    constraints.pairs[p].update_poses(tree);
    const PairPartials pair_partials(tree, constraints.pairs[p], B ? v : nullptr);
    WrenchPartials sum, scratch;
    for (int k : pair_rows) {
      if (position[k] < 0) continue;
      WrenchPartials& row_partials = wrench_partials ? (*wrench_partials)[k] : scratch;
      row_partials.clear();
      constraints.rows[k].partials(pair_partials.pair, row_partials);
      if (B) pair_partials.power(row_partials.F, row_partials, B->data() + position[k] * m);
      if (K) sum.add(lam[k], row_partials);
    }
    if (!K) continue;
    pair_partials.generalized_force(sum, K, m);
    if (wrenches) wrenches->push_back({&pair_partials.pair, sum, true});
  }
  for (int k : selected.in_use())
    if (constraints.rows[k].between_joints())
      constraints.rows[k].coordinate_partials(q, v, K ? lam[k] : 0, K, B ? B->data() + position[k] * m : nullptr, m);
}

}  // namespace mbdae
