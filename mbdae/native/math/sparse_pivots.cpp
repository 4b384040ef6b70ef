// Cholesky elimination of a sparse matrix with diagonal pivoting in a window.
#include "math/sparse_pivots.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

// The rows of S in elimination and all rows coupled with them, as a dense matrix: rows enter when a pivot couples with
// them. The rows of chains are few at a time.
class Front {
 public:
  explicit Front(const std::vector<SparseRow>& S) : S_(S), slot_(S.size(), -1) {}

  int slot(int row) const { return slot_[row]; }  // -1: not in the front
  int row(int slot) const { return row_[slot]; }  // -1: none
  int size() const { return static_cast<int>(row_.size()); }
  double* entries(int slot) { return &entries_[static_cast<size_t>(slot) * capacity_]; }  // (size,) by slot

  void enter(int row) {
    if (slot_[row] >= 0) return;
    const int k = free_slot();
    row_[k] = row, slot_[row] = k;
    for (const auto& [j, x] : S_[row])
      if (const int l = slot_[j]; l >= 0) entries(k)[l] = entries(l)[k] = x;
  }
  void leave(int row) {
    const int k = slot_[row];
    if (k < 0) return;
    for (int l = 0; l < size(); ++l) entries(k)[l] = entries(l)[k] = 0;
    row_[k] = slot_[row] = -1, free_.push_back(k);
  }

 private:
  int free_slot() {
    if (!free_.empty()) {
      const int k = free_.back();
      free_.pop_back();
      return k;
    }
    if (row_.size() == capacity_) {
      const size_t larger = std::max<size_t>(8, 2 * capacity_);
      Vector entries(larger * larger, 0.0);
      for (size_t k = 0; k < capacity_; ++k)
        std::copy_n(&entries_[k * capacity_], capacity_, &entries[k * larger]);
      entries_.swap(entries), capacity_ = larger;
    }
    row_.push_back(-1);
    return size() - 1;
  }

  const std::vector<SparseRow>& S_;
  std::vector<int> slot_, row_, free_;  // of rows, of slots, free slots
  size_t capacity_ = 0;
  Vector entries_;  // (capacity, capacity)
};

}  // namespace

void sparse_pivots(const std::vector<SparseRow>& S, const std::vector<int>& sequence, int window, int count,
                   double smallest, std::vector<int>& order, Vector& pivots) {
  const int n = static_cast<int>(S.size());
  Vector diagonal(n);  // -1: eliminated
  for (int i = 0; i < n; ++i)
    for (const auto& [j, x] : S[i])
      if (j == i) diagonal[i] = x;
  // A row whose pivot is rounding error depends on earlier rows and is omitted; otherwise all such rows would couple.
  const double first = n ? *std::max_element(diagonal.begin(), diagonal.end()) : 0;
  const double negligible = smallest * smallest * first;
  std::vector<std::pair<double, int>> eliminated;
  std::vector<int> candidates;  // the first rows of the sequence that are not eliminated
  Front front(S);
  Vector pivot_row;
  for (auto next = sequence.begin();;) {
    candidates.erase(
        std::remove_if(candidates.begin(), candidates.end(), [&](int k) { return !(diagonal[k] > negligible); }),
        candidates.end());
    for (; next != sequence.end() && static_cast<int>(candidates.size()) < window; ++next)
      if (diagonal[*next] > negligible) candidates.push_back(*next);
    if (candidates.empty()) break;
    double largest = 0;
    for (int k : candidates) largest = std::max(largest, diagonal[k]);
    // Of equal pivots the first: symmetric mechanisms have many, and rounding must not decide.
    int p = n;
    for (int k : candidates)
      if (diagonal[k] > largest * (1 - smallest)) p = std::min(p, k);
    const double pivot = diagonal[p];
    eliminated.emplace_back(pivot, p);
    front.enter(p);
    for (const auto& [j, x] : S[p])
      if (diagonal[j] > negligible) front.enter(j);
    const double* entries = front.entries(front.slot(p));
    pivot_row.assign(entries, entries + front.size());
    pivot_row[front.slot(p)] = 0, diagonal[p] = -1, front.leave(p);
    for (int k = 0; k < front.size(); ++k) {
      const int i = front.row(k);
      if (i < 0 || pivot_row[k] == 0) continue;
      const double f = pivot_row[k] / pivot;
      double* row = front.entries(k);
      for (int l = 0; l < front.size(); ++l) row[l] -= f * pivot_row[l];
      diagonal[i] = std::min(diagonal[i], std::max(0.0, row[k]));
      if (!(diagonal[i] > negligible)) pivot_row[k] = 0, front.leave(i);
    }
  }
  std::stable_sort(eliminated.begin(), eliminated.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  eliminated.resize(std::min<size_t>(eliminated.size(), count));
  order.clear(), pivots.clear();
  for (const auto& [pivot, p] : eliminated) order.push_back(p), pivots.push_back(std::sqrt(pivot));
}

}  // namespace mbdae
