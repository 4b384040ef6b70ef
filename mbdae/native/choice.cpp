// The rows in use: independent ones, chosen anew where they become worse than others (mbdae/mechanism/rows.py).
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core.hpp"
#include "small.hpp"

namespace mbdae {

namespace {

constexpr double WORST_CONDITIONING = 0.1;  // mbdae/mechanism/rows.py
constexpr double GROWN = 1e-2;
constexpr double REASON = 0.01;  // of the best ratio of pivots since the last choice

}  // namespace

void Core::use(const std::vector<int>& rows, int rank_, double floor_, bool held) {
  rank = rank_, floor = floor_, held_ = held;
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
    if (other < half)
      half = other;
    else
      for (int i = 0; i < r; ++i) position_[rows_[i]] = old[i];
  }
  lu_.resize(r, half);
  dropped_.clear();
  for (int k = 0; k < ng; ++k)
    if (position_[k] < 0) dropped_.push_back(k);
}

bool Core::choose_all() {  // where Z stands: see Descriptor.choose_rows and mbdae/mechanism/rows.py
  if (rank < 0) throw std::logic_error("say which rows are in use first");
  pivots(nv, ng, Z_.data(), order_, diag_, work_);
  if (rank && !(diag_[rank - 1] > floor * diag_[0])) throw Trouble();
  if (static_cast<int>(diag_.size()) > rank && diag_[rank] > GROWN * diag_[0]) throw Trouble();
  if (rank) weakest = std::min(weakest, (diag_[rank - 1] / diag_[0]) * (diag_[rank - 1] / diag_[0]));
  if (chosen_) {
    if (rank == ng || !rank) return false;
    const double best = diag_[rank - 1];
    Numbers &B = own_[0], &d = own_[1];
    B.resize(static_cast<size_t>(rank) * nv);
    for (int i = 0; i < rank; ++i)
      std::copy_n(&Z_[static_cast<size_t>(rows_[i]) * nv], nv, &B[static_cast<size_t>(i) * nv]);
    pivots(nv, rank, B.data(), spare_, d, work_);
    if (d[rank - 1] >= WORST_CONDITIONING * best) return false;
  }
  std::vector<int> rows(order_.begin(), order_.begin() + rank);
  std::sort(rows.begin(), rows.end());
  if (chosen_ && rows == rows_) return false;
  set_rows(rows);
  return true;
}

// Where a step begins, and Z stands: small systems look at all rows, large ones where there is reason to.
bool Core::choose() {
  if (large_) {
    best_ = std::max(best_, now_);
    if (!suspicious_ && !fallen()) return false;
  }
  const bool changed = choose_all();
  suspicious_ = false, best_ = 0;
  return changed;
}

// Between two steps, see Descriptor.settle: which rows serve, and how far all of them are kept. True where others are
// taken; v is brought onto them then, and the carried derivative is found anew.
bool Core::settle(double t, State& s) {
  if (!ng) return false;
  const double* q = s.y.data();
  double* v = s.y.data() + nq;
  if (!at_last(q)) evaluate(q, true);
  const bool changed = choose();
  Numbers& rate = lam_work_;
  auto measure = [&] {
    std::fill(rate.begin(), rate.end(), 0.0);
    if (!constraints.drivers.empty()) constraints.speed(t, rate.data());
    for (int k = 0; k < ng; ++k)
      for (int c : constraints.rows[k].columns) rate[k] += G_[static_cast<size_t>(k) * nv + c] * v[c];
  };
  measure();
  if (changed) {
    symmetric();
    normal(rate, f_.data());
    for (int i = 0; i < nv; ++i) v[i] -= f_[i];
    if (!s.carry.empty()) {
      Numbers F(ny), z(ng);
      derivative(t, s.y.data(), F.data(), z.data());
      s.carry.assign(F.begin() + nv, F.end());
    }
    measure();
  }
  std::copy(g_.begin(), g_.end(), gap_.begin());
  constraints.gaps(t, gap_.data());
  widest = std::max(widest, largest(gap_.data(), ng));
  fastest = std::max(fastest, largest(rate.data(), ng) / (1 + largest(v, nv)));
  return changed;
}

// M^-1 G^T (G M^-1 G^T)^-1 of the rows in use times a vector by row, where Z stands and `symmetric` was called.
void Core::normal(Numbers& by_row, double* out) {
  const int r = static_cast<int>(rows_.size());
  tmp_.resize(std::max(nv, r));
  for (int k : rows_) tmp_[position_[k]] = by_row[k];
  lu_.solve(tmp_.data());
  std::fill(out, out + nv, 0.0);
  for (int k : rows_)
    for (int c : constraints.rows[k].columns) out[c] += Z_[static_cast<size_t>(k) * nv + c] * tmp_[position_[k]];
  back(out);
}

// Where Z stands and the symmetric system is factorized: do the rows that are not in use still depend on the others? A
// vector that those in use leave alone is left alone by the others too.
void Core::probe() {
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

bool Core::fallen() const { return now_ < REASON * best_; }

double Core::ratio(const double* q) {
  if (!at_last(q)) evaluate(q, false);
  pivots(nv, ng, Z_.data(), order_, diag_, work_);
  return diag_[std::max(rank, 1) - 1] / diag_[0];
}

}  // namespace mbdae
