// Selection of the rows in use by pivoted QR, or by sparse elimination for many rows.
#include "system/independent_rows.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <stdexcept>

namespace mbdae {

IndependentRows::IndependentRows(const Constraints& constraints, std::vector<int> elimination, int nv,
                                 const Tolerances& tolerances, bool positions)
    : constraints_(constraints),
      tolerances_(tolerances),
      nv_(nv),
      elimination_(std::move(elimination)),
      neighbours_(constraints.rows.size()),
      excluded_(constraints.rows.size()),
      position_(constraints.rows.size(), -1) {
  std::vector<std::vector<int>> users(nv);
  for (int k : constraints.all)
    for (int c : constraints.rows[k].columns) users[c].push_back(k);
  for (int k : constraints.all) {
    excluded_[k] = positions && !constraints.rows[k].positional;
    std::set<int> coupled;
    for (int c : constraints.rows[k].columns) coupled.insert(users[c].begin(), users[c].end());
    neighbours_[k].assign(coupled.begin(), coupled.end());
    for (int l : coupled) window_ = std::max(window_, 2 * std::abs(elimination_[k] - elimination_[l]) + 2);
  }
  window_ = std::max(window_, tolerances_.many_rows);
}

void IndependentRows::find_pivots(const Vector& Z, bool of_rows_in_use, int count, double smallest,
                                  std::vector<int>& order, Vector& pivots) const {
  const std::vector<SparseRow> S = products(Z, of_rows_in_use);
  std::vector<int> sequence(S.size());
  for (size_t k = 0; k < S.size(); ++k) sequence[of_rows_in_use ? k : elimination_[k]] = static_cast<int>(k);
  sparse_pivots(S, sequence, window_, count, smallest, order, pivots);
}

void IndependentRows::use(const std::vector<int>& rows, int rank_, double floor_, bool frozen_) {
  rank = rank_, floor = floor_, frozen = frozen_;
  if (!version_ || rows != rows_) set(rows);
}

void IndependentRows::reset() {
  rank = -1, floor = 0, frozen = false, least_pivot_ratio = 1, last_ratio_ = NAN;
  set({});
}

void IndependentRows::record_ratio(double ratio) {
  last_ratio_ = ratio, least_pivot_ratio = std::min(least_pivot_ratio, ratio);
}

void IndependentRows::set(std::vector<int> rows) {
  rows_ = std::move(rows);
  ++version_, remaining_independent = false, best_ratio_ = 0;
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
  remaining_.clear();
  for (size_t k = 0; k < position_.size(); ++k)
    if (position_[k] < 0 && !excluded_[k]) remaining_.push_back(static_cast<int>(k));
}

void IndependentRows::update_pivots(const Vector& Z, long stamp) {
  if (pivots_stamp_ == stamp) return;
  if (has_many()) {  // further pivots are rounding errors
    find_pivots(Z, false, rank + 1, std::sqrt(tolerances_.eps), order_, pivots_);
  } else {
    constraints_.dense(constraints_.all, Z, factors_);
    pivoted_qr(nv_, static_cast<int>(position_.size()), factors_, order_, pivots_);
  }
  pivots_stamp_ = stamp;
}

bool IndependentRows::factorize(const Vector& Z, long stamp) {
  if (has_many() || rows_.empty() || rows_.size() < position_.size()) return false;
  update_pivots(Z, stamp);
  return pivots_.back() * pivots_.back() > tolerances_.smallest_pivot * pivots_[0] * pivots_[0];
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

bool IndependentRows::select(const Vector& Z, long stamp) {
  if (rank < 0) throw std::logic_error("the rows in use are not set");
  const int ng = static_cast<int>(position_.size());
  update_pivots(Z, stamp);
  const int n_pivots = static_cast<int>(pivots_.size());
  if (n_pivots < rank || (rank && !(pivots_[rank - 1] > floor * pivots_[0]))) throw FallBackToPython();
  if (n_pivots > rank && pivots_[rank] > tolerances_.growth_tolerance * pivots_[0]) throw FallBackToPython();
  if (rank) {
    const double smallest = pivots_[rank - 1] / pivots_[0];
    least_pivot_ratio = std::min(least_pivot_ratio, smallest * smallest);
  }
  if (version_) {
    if (rank == ng || !rank || uses_first_pivots()) return false;
    if (smallest_pivot_in_use(Z) >= tolerances_.worst_conditioning * pivots_[rank - 1]) return false;
  }
  return use_first_pivots();
}

bool IndependentRows::uses_first_pivots() const {
  return std::all_of(order_.begin(), order_.begin() + rank, [&](int k) { return position_[k] >= 0; });
}

std::vector<int> IndependentRows::first_pivots(int count) const {
  std::vector<int> rows(order_.begin(), order_.begin() + count);
  std::sort(rows.begin(), rows.end(), [&](int k, int l) { return elimination_[k] < elimination_[l]; });
  return rows;
}

std::vector<int> IndependentRows::independent(const Vector& Z, int count, double smallest_ratio) {
  pivots_stamp_ = -1;
  find_pivots(Z, false, count, std::max(smallest_ratio, std::sqrt(tolerances_.eps)), order_, pivots_);
  return first_pivots(static_cast<int>(order_.size()));
}

bool IndependentRows::use_first_pivots() {
  std::vector<int> rows = first_pivots(rank);
  if (version_ && rows == rows_) return false;
  set(std::move(rows));
  return true;
}

double IndependentRows::smallest_pivot_in_use(const Vector& Z) {
  if (has_many()) {
    find_pivots(Z, true, rank, std::sqrt(tolerances_.eps), order_in_use_, pivots_in_use_);
    return static_cast<int>(pivots_in_use_.size()) < rank ? 0 : pivots_in_use_[rank - 1];
  }
  constraints_.dense(rows_, Z, work_);
  pivoted_qr(nv_, rank, work_, order_in_use_, pivots_in_use_);
  return pivots_in_use_[rank - 1];
}

bool IndependentRows::select_if_triggered(const Vector& Z, long stamp) {
  const double ratio = last_ratio_;
  last_ratio_ = NAN;
  best_ratio_ = std::max(best_ratio_, ratio);
  if (has_many() && !remaining_independent && ratio >= tolerances_.reselection_ratio * best_ratio_) return false;
  remaining_independent = false, best_ratio_ = 0;
  return select(Z, stamp);
}

SmallestPivot IndependentRows::smallest_pivot(const Vector& Z, int rank) {
  pivots_stamp_ = -1;
  if (has_many()) {
    find_pivots(Z, false, rank, std::sqrt(tolerances_.eps), order_, pivots_);
    if (static_cast<int>(pivots_.size()) < rank) return {0, 0};
  } else {
    constraints_.dense(constraints_.all, Z, work_);
    pivoted_qr(nv_, static_cast<int>(position_.size()), work_, order_, pivots_);
  }
  return {pivots_[rank - 1], pivots_[rank - 1] / pivots_[0]};
}

std::vector<SparseRow> IndependentRows::products(const Vector& Z, bool of_rows_in_use) const {
  const int ng = static_cast<int>(position_.size());
  std::vector<SparseRow> S(of_rows_in_use ? rows_.size() : ng);
  for (int k = 0; k < ng; ++k) {
    if (of_rows_in_use && position_[k] < 0) continue;
    SparseRow& row = S[of_rows_in_use ? position_[k] : k];
    for (int l : neighbours_[k]) {
      if (of_rows_in_use && position_[l] < 0) continue;
      row.emplace_back(of_rows_in_use ? position_[l] : l, constraints_.product(k, l, Z.data()));
    }
    if (of_rows_in_use) std::sort(row.begin(), row.end());
  }
  return S;
}

}  // namespace mbdae
