// Cholesky elimination of a sparse matrix with diagonal pivoting in a window.
#include "math/sparse_pivots.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

void sparse_pivots(std::vector<SparseRow>& S, const std::vector<int>& sequence, int window, int count, double smallest,
                   std::vector<int>& order, Vector& pivots) {
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
  SparseRow updated_row;
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
    diagonal[p] = -1;
    for (const auto& [i, x] : S[p]) {
      if (i == p || diagonal[i] <= negligible) continue;
      const double f = x / pivot;
      double new_diagonal = 0;
      updated_row.clear();
      auto a = S[i].begin();
      for (const auto& [j, y] : S[p]) {
        for (; a != S[i].end() && a->first < j; ++a) updated_row.push_back(*a);
        const bool both = a != S[i].end() && a->first == j;
        if (j != p && diagonal[j] > negligible) updated_row.emplace_back(j, (both ? a->second : 0.0) - f * y);
        if (j == i) new_diagonal = updated_row.back().second;
        a += both;
      }
      updated_row.insert(updated_row.end(), a, S[i].end());
      S[i].swap(updated_row);
      diagonal[i] = std::min(diagonal[i], std::max(0.0, new_diagonal));
    }
    SparseRow().swap(S[p]);
  }
  std::stable_sort(eliminated.begin(), eliminated.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  eliminated.resize(std::min<size_t>(eliminated.size(), count));
  order.clear(), pivots.clear();
  for (const auto& [pivot, p] : eliminated) order.push_back(p), pivots.push_back(std::sqrt(pivot));
}

}  // namespace mbdae
