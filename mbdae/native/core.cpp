#include "core.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace mbdae {

namespace {

constexpr int LARGE = 32;                  // rows: beyond, the choice of rows is looked at when there is reason to
constexpr double RANK_TOLERANCE = 1e-8;    // mbdae/mechanism/rows.py
constexpr double WORST_CONDITIONING = 0.1;
constexpr double GROWN = 1e-2;
constexpr double REASON = 0.01;            // of the best ratio of pivots since the last choice
constexpr double LARGEST_TURN = 3.0;       // rad within one step (mbdae/mechanism/manifold.py)
constexpr double TRUNCATION = 1e-7, ROUNDING = 1e-14, OPEN = 1e-9, STALLED = 1e-9;  // mbdae/mechanism/project.py
constexpr int ITERATIONS = 10;

double largest(const double* x, int n) {
  double s = 0;
  for (int i = 0; i < n; ++i) s = std::max(s, std::fabs(x[i]));
  return s;
}

double norm(const double* x, int n) {
  double s = 0;
  for (int i = 0; i < n; ++i) s += x[i] * x[i];
  return std::sqrt(s);
}

double dot(const double* x, const double* y, int n) {
  double s = 0;
  for (int i = 0; i < n; ++i) s += x[i] * y[i];
  return s;
}

bool finite(const double* x, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

}  // namespace

Core::Core(const void* model, bool flat, std::vector<Row> rows, std::vector<std::pair<Anchor, Anchor>> pairs,
           std::vector<Driver> drivers, std::vector<Law> laws, std::vector<std::pair<Anchor, Anchor>> law_pairs,
           std::vector<int> pair_of_law, int ns_, std::vector<Block> blocks, std::vector<int> turning)
    : m(model), nq(m.nq), nv(m.nv), ng(static_cast<int>(rows.size())), ns(ns_), ny(2 * nv + ns + 1),
      length(nq + nv + ns + 1), flat_(flat), large_(ng > LARGE), laws_(std::move(laws)), blocks_(std::move(blocks)),
      turning_(std::move(turning)) {
  const std::vector<std::vector<int>> supports = m.supports();
  for (auto& p : pairs) constraints.pairs.emplace_back(m, p.first, p.second, supports);
  for (auto& p : law_pairs) law_pairs_.emplace_back(m, p.first, p.second, supports);
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
    if (r.kind == Row::gap || r.kind == Row::axes) constraints.pairs[r.pair].turns_a = true;
    if (r.kind == Row::axes) constraints.pairs[r.pair].turns_b = true;
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
  for (Numbers* x : {&g_, &gt_, &gthat_, &lam_}) x->assign(ng, 0.0);
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
  for (int i = 0; i < nq; ++i) size = std::max(size, std::fabs(q[i])), move = std::max(move, std::fabs(q[i] - last_q_[i]));
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
  struct Entry {
    int i, j;
    double s;
  };
  static thread_local std::vector<Entry> cross;  // S_DR
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
}

// -- the rows in use --------------------------------------------------------------------------------------------------

void Core::use(const std::vector<int>& rows, int rank_) {
  rank = rank_;
  stands_ = false;
  if (!chosen_ || rows != rows_) set_rows(rows);
}

void Core::set_rows(std::vector<int> rows) {
  rows_ = std::move(rows);
  chosen_ = true, suspicious_ = false, best_ = 0;
  std::fill(position_.begin(), position_.end(), -1);
  const int r = static_cast<int>(rows_.size());
  for (int i = 0; i < r; ++i) position_[rows_[i]] = i;
  std::vector<std::vector<int>> graph(r);
  auto width = [&] {
    int w = 0;
    for (int i = 0; i < r; ++i)
      for (int j : graph[i]) w = std::max(w, std::abs(position_[rows_[i]] - position_[rows_[j]]));
    return w;
  };
  for (int i = 0; i < r; ++i)
    for (int l : neighbours_[rows_[i]])
      if (position_[l] >= 0 && l != rows_[i]) graph[i].push_back(position_[l]);
  int half = width();
  if (r > LARGE) {
    const std::vector<int> order = cuthill_mckee(graph);
    std::vector<int> old(r);
    for (int i = 0; i < r; ++i) old[i] = position_[rows_[i]];
    for (int i = 0; i < r; ++i) position_[rows_[order[i]]] = i;
    const int other = width();
    if (other < half) half = other;
    else
      for (int i = 0; i < r; ++i) position_[rows_[i]] = old[i];
  }
  lu_.resize(r, half);
  dropped_.clear();
  for (int k = 0; k < ng; ++k)
    if (position_[k] < 0) dropped_.push_back(k);
}

void Core::choose_all() {  // where Z stands: see Descriptor.choose_rows and mbdae/mechanism/rows.py
  pivots(nv, ng, Z_.data(), order_, diag_, work_);
  int r = 0;
  for (double d : diag_) r += d > RANK_TOLERANCE * diag_[0];
  if (rank < 0) rank = r;
  if (r < rank || (static_cast<int>(diag_.size()) > rank && diag_[rank] > GROWN * diag_[0])) throw Trouble();
  if (rank) weakest = std::min(weakest, (diag_[rank - 1] / diag_[0]) * (diag_[rank - 1] / diag_[0]));
  if (chosen_) {
    if (rank == ng || !rank) return;
    const double best = diag_[rank - 1];
    Numbers &B = own_[0], &d = own_[1];
    B.resize(static_cast<size_t>(rank) * nv);
    for (int i = 0; i < rank; ++i) std::copy_n(&Z_[static_cast<size_t>(rows_[i]) * nv], nv, &B[static_cast<size_t>(i) * nv]);
    pivots(nv, rank, B.data(), spare_, d, work_);
    if (d[rank - 1] >= WORST_CONDITIONING * best) return;
  }
  std::vector<int> rows(order_.begin(), order_.begin() + rank);
  std::sort(rows.begin(), rows.end());
  set_rows(rows);
}

// At the start of a step, before begin: small systems look at all rows, large ones where there is reason to.
void Core::choose() {
  if (!ng) {
    rank = 0, chosen_ = true;
    return;
  }
  if (large_ && chosen_) {
    best_ = std::max(best_, now_);
    if (!suspicious_ && !(now_ < REASON * best_)) return;
  }
  if (!at_last(q0_.data())) evaluate(q0_.data(), true);
  choose_all();
  suspicious_ = false, best_ = 0;
}

double Core::ratio(const double* q) {
  if (!at_last(q)) evaluate(q, false);
  pivots(nv, ng, Z_.data(), order_, diag_, work_);
  return diag_[std::max(rank, 1) - 1] / diag_[0];
}

// -- the manifold -----------------------------------------------------------------------------------------------------

void Core::integrate(const double* q, const double* x, double* out) {
  if (!flat_) return m.integrate(q, x, out);
  for (int i = 0; i < nq; ++i) out[i] = q[i] + x[i];
}

void Core::within(const double* x) const {
  for (const Block& b : blocks_) {
    const double turn = b.kind == Block::se2 ? std::fabs(x[b.at + 2]) : norm(x + b.at + (b.kind == Block::se3 ? 3 : 0), 3);
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
  choose();
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
  if (a.first) out.carry.assign(F + static_cast<size_t>(n - 1) * stride + nv, F + static_cast<size_t>(n - 1) * stride + ny);
  const bool dependent = !dropped_.empty() && !rows_.empty();
  if (!rows_.empty() && (a.project || dependent)) symmetric();
  errors.resize(static_cast<size_t>(a.errors) * ny);
  for (int e = 0; e < a.errors; ++e) {
    double* x = &errors[static_cast<size_t>(e) * ny];
    combine(&a.e[e * n], n, xhat_.data());
    std::copy_n(xhat_.data(), ny, x);
    if (!a.project || rows_.empty()) continue;
    counts.projections += 1;
    const int r = static_cast<int>(rows_.size());
    tmp_.resize(std::max(nv, r));
    for (int k : rows_) {
      double s = 0;
      for (int c : constraints.rows[k].columns) s += G_[static_cast<size_t>(k) * nv + c] * x[nv + c];
      tmp_[position_[k]] = s;
    }
    lu_.solve(tmp_.data());
    std::fill(f_.begin(), f_.end(), 0.0);
    for (int k : rows_)
      for (int c : constraints.rows[k].columns) f_[c] += Z_[static_cast<size_t>(k) * nv + c] * tmp_[position_[k]];
    back(f_.data());
    for (int i = 0; i < nv; ++i) x[nv + i] -= f_[i];
  }
  own(lam_.data(), z);
  if (large_ && dependent) {  // do the rows that are not in use still depend on the others?
    const int r = static_cast<int>(rows_.size());
    Numbers w(probe_), u(r);
    double scale = 0;
    for (int k : rows_) {
      double s = 0, size = 0;
      for (int c : constraints.rows[k].columns) {
        const double zc = Z_[static_cast<size_t>(k) * nv + c];
        s += zc * w[c], size += zc * zc;
      }
      u[position_[k]] = s, scale = std::max(scale, size);
    }
    lu_.solve(u.data());
    for (int k : rows_)
      for (int c : constraints.rows[k].columns) w[c] -= Z_[static_cast<size_t>(k) * nv + c] * u[position_[k]];
    for (int k : dropped_) {
      double s = 0;
      for (int c : constraints.rows[k].columns) s += Z_[static_cast<size_t>(k) * nv + c] * w[c];
      if (s * s > 0.01 * GROWN * GROWN * scale / 12) suspicious_ = true;  // components of the probe: variance 1/12
    }
  }
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
  if (at_last(q)) m.inertia(q), counts.M += 1, counts.factorizations += 1, counts.G += ng > 0;  // poses and J
  else evaluate(q, true);
  double* rates = F + 2 * nv;
  forces(t, q, v, v + nv, f_.data(), rates);
  if (ng) {
    if (!large_ || !chosen_ || now_ < REASON * best_) choose_all();
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

double Core::bare(const double* q, const double* v, int repetitions) {
  evaluate(q, false);
  if (ng && !chosen_) choose_all();
  Numbers G;
  for (int k : rows_) G.insert(G.end(), &G_[static_cast<size_t>(k) * nv], &G_[static_cast<size_t>(k) * nv] + nv);
  return m.bare(q, v, static_cast<int>(rows_.size()), G.data(), repetitions);
}

}  // namespace mbdae
