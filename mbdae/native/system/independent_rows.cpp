#include "system/independent_rows.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

namespace mbdae {

IndependentRows::IndependentRows(const Constraints& constraints, std::vector<int> place, int nv, const Tolerances& limits,
                                 bool positions)
    : limits_(limits),
      nv_(nv),
      place_(std::move(place)),
      neighbours_(constraints.rows.size()),
      left_out_(constraints.rows.size()),
      position_(constraints.rows.size(), -1) {
  std::vector<std::vector<int>> users(nv);
  for (int k : constraints.all)
    for (int c : constraints.rows[k].columns) users[c].push_back(k);
  for (int k : constraints.all) {
    left_out_[k] = positions && !constraints.rows[k].positional;
    std::set<int> near;
    for (int c : constraints.rows[k].columns) near.insert(users[c].begin(), users[c].end());
    neighbours_[k].assign(near.begin(), near.end());
  }
}

void IndependentRows::use(const std::vector<int>& rows, int rank_, double floor_, bool held_) {
  rank = rank_, floor = floor_, held = held_;
  if (!version_ || rows != rows_) set(rows);
}

void IndependentRows::reset() {
  rank = -1, floor = 0, held = false, least_pivot_ratio = 1, now_ = NAN;
  set({});
}

void IndependentRows::met(double ratio) { now_ = ratio, least_pivot_ratio = std::min(least_pivot_ratio, ratio); }

void IndependentRows::set(std::vector<int> rows) {
  rows_ = std::move(rows);
  ++version_, estranged = false, best_ = 0;
  std::fill(position_.begin(), position_.end(), -1);
  const int r = static_cast<int>(rows_.size());
  for (int i = 0; i < r; ++i) position_[rows_[i]] = i;
  half_bandwidth_ = 0, coupled_.assign(r, {});
  for (int i = 0; i < r; ++i) {
    for (int l : neighbours_[rows_[i]])
      if (position_[l] >= 0 && position_[l] <= i) coupled_[i].push_back(position_[l]);
    std::sort(coupled_[i].begin(), coupled_[i].end());
    half_bandwidth_ = std::max(half_bandwidth_, i - coupled_[i].front());
  }
  others_.clear();
  for (size_t k = 0; k < position_.size(); ++k)
    if (position_[k] < 0 && !left_out_[k]) others_.push_back(static_cast<int>(k));
}

void IndependentRows::look(const double* Z, long stamp) {
  if (seen_ == stamp) return;
  pivots(nv_, static_cast<int>(position_.size()), Z, order_, pivots_, factors_);
  seen_ = stamp;
}

bool IndependentRows::factorize(const double* Z, long stamp) {
  if (many() || rows_.empty() || rows_.size() < position_.size()) return false;
  look(Z, stamp);
  return pivots_.back() * pivots_.back() > limits_.smallest_pivot * pivots_[0] * pivots_[0];
}

void IndependentRows::solve(double* x) const {
  const int n = static_cast<int>(order_.size());
  x_.resize(n);
  for (int j = 0; j < n; ++j) {
    const double* R = &factors_[static_cast<size_t>(j) * nv_];
    double s = x[position_[order_[j]]];
    for (int i = 0; i < j; ++i) s -= R[i] * x_[i];
    x_[j] = s / R[j];
  }
  for (int j = n - 1; j >= 0; --j) {
    const double* R = &factors_[static_cast<size_t>(j) * nv_];
    const double s = x_[j] / R[j];
    for (int i = 0; i < j; ++i) x_[i] -= R[i] * s;
    x[position_[order_[j]]] = s;
  }
}

bool IndependentRows::choose(const double* Z, long stamp) {
  if (rank < 0) throw std::logic_error("say which rows are in use first");
  const int ng = static_cast<int>(position_.size());
  look(Z, stamp);
  if (rank && !(pivots_[rank - 1] > floor * pivots_[0])) throw FallBackToPython();
  if (static_cast<int>(pivots_.size()) > rank && pivots_[rank] > limits_.growth_tolerance * pivots_[0]) throw FallBackToPython();
  if (rank) {
    const double smallest = pivots_[rank - 1] / pivots_[0];
    least_pivot_ratio = std::min(least_pivot_ratio, smallest * smallest);
  }
  if (version_) {
    if (rank == ng || !rank) return false;
    B_.resize(static_cast<size_t>(rank) * nv_);
    for (int i = 0; i < rank; ++i)
      std::copy_n(&Z[static_cast<size_t>(rows_[i]) * nv_], nv_, &B_[static_cast<size_t>(i) * nv_]);
    pivots(nv_, rank, B_.data(), order_in_use_, pivots_in_use_, work_);
    if (pivots_in_use_[rank - 1] >= limits_.worst_conditioning * pivots_[rank - 1]) return false;
  }
  std::vector<int> rows(order_.begin(), order_.begin() + rank);
  std::sort(rows.begin(), rows.end(), [&](int k, int l) { return place_[k] < place_[l]; });
  if (version_ && rows == rows_) return false;
  set(std::move(rows));
  return true;
}

bool IndependentRows::choose_with_reason(const double* Z, long stamp) {
  const double now = now_;
  now_ = NAN;
  best_ = std::max(best_, now);
  if (many() && !estranged && now >= limits_.reselection_ratio * best_) return false;
  estranged = false, best_ = 0;
  return choose(Z, stamp);
}

double IndependentRows::ratio(const Constraints& constraints, const double* Z, int rank) {
  const int ng = static_cast<int>(position_.size());
  if (!many()) {
    seen_ = -1;
    pivots(nv_, ng, Z, order_, pivots_, work_);
    return pivots_[rank - 1] / pivots_[0];
  }
  std::vector<SparseRow> S(ng);
  for (int k = 0; k < ng; ++k)
    for (int l : neighbours_[k]) {
      double s = 0;
      for (int c : constraints.rows[k].columns)
        s += Z[static_cast<size_t>(k) * nv_ + c] * Z[static_cast<size_t>(l) * nv_ + c];
      S[k].emplace_back(l, s);
    }
  return pivot_ratio(S, rank, limits_.eps);
}

}  // namespace mbdae
