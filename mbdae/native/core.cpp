// A point: mass matrix, constraint Jacobian, saddle-point solves and multipliers.
#include "core.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "small.hpp"

namespace mbdae {

Core::Core(const void* model, bool flat, std::vector<Row> rows, std::vector<std::pair<Anchor, Anchor>> pairs,
           std::vector<Driver> drivers, std::vector<Law> laws, std::vector<std::pair<Anchor, Anchor>> law_pairs,
           std::vector<int> pair_of_law, int ns_, std::vector<Block> blocks, std::vector<int> turning)
    : m(model),
      nq(m.nq),
      nv(m.nv),
      ng(static_cast<int>(rows.size())),
      ns(ns_),
      ny(2 * nv + ns + 1),
      length(nq + nv + ns + 1),
      flat_(flat),
      large_(ng > LARGE),
      laws_(std::move(laws)),
      blocks_(std::move(blocks)),
      turning_(std::move(turning)) {
  const std::vector<std::vector<int>> supports = m.supports();
  for (auto& p : pairs) constraints.pairs.emplace_back(p.first, p.second, supports);
  for (auto& p : law_pairs) law_pairs_.emplace_back(p.first, p.second, supports);
  for (size_t i = 0; i < laws_.size(); ++i)
    if (pair_of_law[i] >= 0) laws_[i].pair = &law_pairs_[pair_of_law[i]];
  constraints.drivers = std::move(drivers);
  for (Row& r : rows) {
    if (r.kind == Row::coordinate) {
      std::set<int> all;
      for (int i : r.iv)
        if (i >= 0) all.insert(i), all.insert(m.ancestors[i].begin(), m.ancestors[i].end());
      r.columns.assign(all.begin(), all.end());
    } else {
      r.columns = constraints.pairs[r.pair].columns;
    }
  }
  constraints.rows = std::move(rows);
  for (Pair& p : constraints.pairs) p.turns_a = p.turns_b = false;
  for (const Row& r : constraints.rows) {
    if (r.has_a) constraints.pairs[r.pair].turns_a = true;
    if (r.has_b) constraints.pairs[r.pair].turns_b = true;
  }
  all_.resize(ng), position_.assign(ng, -1), neighbours_.resize(ng);
  std::vector<std::vector<int>> users(nv);
  for (int k = 0; k < ng; ++k) {
    all_[k] = k;
    for (int c : constraints.rows[k].columns) users[c].push_back(k);
  }
  for (int k = 0; k < ng; ++k) {
    std::set<int> near;
    for (int c : constraints.rows[k].columns) near.insert(users[c].begin(), users[c].end());
    neighbours_[k].assign(near.begin(), near.end());
  }
  const size_t full = static_cast<size_t>(ng) * nv;
  for (Numbers* x : {&G_, &Z_, &Ghat_, &Zhat_}) x->assign(full, 0.0);
  for (Numbers* x : {&g_, &gt_, &gthat_, &lam_, &lam_work_, &gap_}) x->assign(ng, 0.0);
  for (Numbers* x : {&f_, &root_, &conservative_, &other_, &v_, &v0_, &tmp_, &probe_}) x->assign(nv, 0.0);
  stride_ = (ny + 3) / 4 * 4;
  for (Numbers* x : {&dx_, &x_, &xhat_}) x->assign(stride_, 0.0);
  for (Numbers* x : {&q_, &qhat_, &q0_, &neutral_}) x->assign(nq, 0.0);
  for (Numbers* x : {&s_, &s0_}) x->assign(ns + 1, 0.0);
  U_.assign(static_cast<size_t>(nv) * nv, 0.0);
  last_q_.assign(nq, NAN);
  m.neutral(neutral_.data());
  unsigned seed = 12345;  // any vector in general position
  for (double& x : probe_) seed = 1664525u * seed + 1013904223u, x = seed / 4294967296.0 - 0.5;
}

// -- a point ----------------------------------------------------------------------------------------------------------

void Core::inertia(const double* q) {
  m.inertia(q);
  const double* M = m.M();
  stands_ = false;
  for (int k = 0; k < nv; ++k) {
    double* c = &U_[static_cast<size_t>(k) * nv];
    const double* from = M + static_cast<size_t>(k) * nv;
    c[k] = from[k];
    for (int i : m.ancestors[k]) c[i] = from[i];
  }
  for (int k = nv - 1; k >= 0; --k) {
    const double* c = &U_[static_cast<size_t>(k) * nv];
    const double d = c[k];
    if (!(d > 0) || !std::isfinite(d)) throw Trouble();
    root_[k] = std::sqrt(d);
    double* write = &U_[static_cast<size_t>(k) * nv];
    for (int i : m.ancestors[k]) {
      const double a = c[i] / d;
      double* ci = &U_[static_cast<size_t>(i) * nv];
      ci[i] -= a * c[i];
      for (int j : m.ancestors[i]) ci[j] -= a * c[j];
    }
    for (int i : m.ancestors[k]) write[i] /= d;
  }
}

void Core::half(double* x) const {  // x := D^-1/2 U^-1 x
  for (int k = nv - 1; k >= 0; --k) {
    const double* c = &U_[static_cast<size_t>(k) * nv];
    for (int i : m.ancestors[k]) x[i] -= c[i] * x[k];
    x[k] /= root_[k];
  }
}

void Core::half(double* x, const std::vector<int>& columns) const {
  for (size_t j = columns.size(); j-- > 0;) {
    const int k = columns[j];
    const double* c = &U_[static_cast<size_t>(k) * nv];
    for (int i : m.ancestors[k]) x[i] -= c[i] * x[k];
    x[k] /= root_[k];
  }
}

void Core::back(double* x) const {  // x := U^-T D^-1/2 x
  for (int k = 0; k < nv; ++k) {
    const double* c = &U_[static_cast<size_t>(k) * nv];
    double s = x[k] / root_[k];
    for (int i : m.ancestors[k]) s -= c[i] * x[i];
    x[k] = s;
  }
}

void Core::evaluate(const double* q, bool counted) {
  inertia(q);
  constraints.value(m, q, all_, G_.data(), g_.data());
  std::copy(G_.begin(), G_.end(), Z_.begin());
  for (int k : all_) half(&Z_[static_cast<size_t>(k) * nv], constraints.rows[k].columns);
  if (counted) counts.M += 1, counts.factorizations += 1, counts.G += ng > 0;
  std::copy(q, q + nq, last_q_.begin());
  stands_ = true;
}

bool Core::at_last(const double* q) const {  // the last stage ended here
  if (!stands_) return false;
  double size = 0, move = 0;
  for (int i = 0; i < nq; ++i)
    size = std::max(size, std::fabs(q[i])), move = std::max(move, std::fabs(q[i] - last_q_[i]));
  return move <= 1e-15 * (1 + size);
}

void Core::forces(double t, const double* q, const double* v, const double* s, double* f, double* rates) {
  counts.f += 1;
  std::fill(conservative_.begin(), conservative_.end(), 0.0);
  std::fill(other_.begin(), other_.end(), 0.0);
  for (const Law& law : laws_)
    law.add(m, t, q, v, s + law.state, conservative_.data(), other_.data(), rates + law.state);
  rates[ns] = dot(other_.data(), v, nv);
  m.bias(q, v, f);
  for (int i = 0; i < nv; ++i) f[i] = conservative_[i] + other_[i] - f[i];
  if (!finite(f, nv)) throw Trouble();
}

void Core::assemble(const double* Zhat) {  // S = Zhat^T Z of the rows in use
  lu_.zero();
  for (int k : rows_) {
    const std::vector<int>& columns = constraints.rows[k].columns;
    const double* a = Zhat + static_cast<size_t>(k) * nv;
    for (int l : neighbours_[k]) {
      if (position_[l] < 0) continue;
      const double* b = &Z_[static_cast<size_t>(l) * nv];
      double s = 0;
      for (int c : columns) s += a[c] * b[c];
      lu_.at(position_[k], position_[l]) = s;
    }
  }
}

// M v' = f + G^T lam, Ghat v' = rhs: rhs (by row) becomes lam, f becomes v'.
void Core::solve(const double* Zhat, double* rhs, double* f) {
  counts.solves += 1;
  half(f);
  const int r = static_cast<int>(rows_.size());
  if (r) {
    counts.factorizations += 1;
    assemble(Zhat);
    const bool regular = lu_.factorize();
    weakest = std::min(weakest, lu_.ratio());
    now_ = lu_.ratio();
    if (!regular || !(lu_.ratio() > 1e-14)) throw Trouble();
    tmp_.resize(std::max(nv, r));
    for (int k : rows_) {
      double s = rhs[k];
      for (int c : constraints.rows[k].columns) s -= Zhat[static_cast<size_t>(k) * nv + c] * f[c];
      tmp_[position_[k]] = s;
    }
    lu_.solve(tmp_.data());
    for (int k : rows_) {
      const double l = rhs[k] = tmp_[position_[k]];
      const double* z = &Z_[static_cast<size_t>(k) * nv];
      for (int c : constraints.rows[k].columns) f[c] += z[c] * l;
    }
  }
  back(f);
  if (!finite(f, nv)) throw Trouble();
}

void Core::symmetric() {  // the factors of G M^-1 G^T where Z stands
  assemble(Z_.data());
  if (!lu_.factorize()) throw Trouble();
}

// Multipliers of all rows (ng,) from those in use, of minimum norm: dependent rows G_D = C G_R give the null vectors
// (-C^T n, n) of G^T, and (1 + C C^T) n = C lam_R; by conjugate gradients, C = G_D M^-1 G_R^T (G_R M^-1 G_R^T)^-1.
void Core::own(const double* lam, double* z) {
  for (int k = 0; k < ng; ++k) z[k] = position_[k] >= 0 ? lam[k] : 0.0;
  const int d = static_cast<int>(dropped_.size()), r = static_cast<int>(rows_.size());
  if (!d || !r) return;
  Numbers &in = own_[0], &x = own_[1], &res = own_[2], &p = own_[3], &Ap = own_[4];
  in.resize(r), x.assign(d, 0.0), res.resize(d), p.resize(d), Ap.resize(d);
  auto product = [&](int k, int l) {
    double s = 0;
    for (int c : constraints.rows[k].columns)
      s += Z_[static_cast<size_t>(k) * nv + c] * Z_[static_cast<size_t>(l) * nv + c];
    return s;
  };
  std::vector<Entry>& cross = cross_;  // S_DR
  cross.clear();
  for (int i = 0; i < d; ++i)
    for (int l : neighbours_[dropped_[i]])
      if (position_[l] >= 0) cross.push_back({i, position_[l], product(dropped_[i], l)});
  auto down = [&](Numbers& u, Numbers& out) {  // out = C u; u is lost
    lu_.solve(u.data());
    std::fill(out.begin(), out.end(), 0.0);
    for (const Entry& e : cross) out[e.i] += e.s * u[e.j];
  };
  auto up = [&](const Numbers& n, Numbers& out) {  // out = C^T n
    std::fill(out.begin(), out.end(), 0.0);
    for (const Entry& e : cross) out[e.j] += e.s * n[e.i];
    lu_.solve(out.data());
  };
  for (int k : rows_) in[position_[k]] = lam[k];
  down(in, res);
  p = res;
  double rho = dot(res.data(), res.data(), d);
  const double enough = 1e-32 * rho;
  for (int it = 0; it < d + 20 && rho > enough && rho > 0; ++it) {
    up(p, in);
    down(in, Ap);
    for (int i = 0; i < d; ++i) Ap[i] += p[i];
    const double alpha = rho / dot(p.data(), Ap.data(), d);
    for (int i = 0; i < d; ++i) x[i] += alpha * p[i], res[i] -= alpha * Ap[i];
    const double next = dot(res.data(), res.data(), d);
    for (int i = 0; i < d; ++i) p[i] = res[i] + next / rho * p[i];
    rho = next;
  }
  up(x, in);
  for (int k : rows_) z[k] -= in[position_[k]];
  for (int i = 0; i < d; ++i) z[dropped_[i]] = x[i];
  if (!finite(z, ng)) throw Trouble();  // in a singular configuration Python finds those of minimum norm
}

double Core::bare(const double* q, const double* v, int repetitions) {
  evaluate(q, false);
  Numbers G;
  for (int k : rows_) G.insert(G.end(), &G_[static_cast<size_t>(k) * nv], &G_[static_cast<size_t>(k) * nv] + nv);
  return m.bare(q, v, static_cast<int>(rows_.size()), G.data(), repetitions);
}

}  // namespace mbdae
