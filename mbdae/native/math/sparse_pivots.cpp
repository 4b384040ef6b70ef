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
  // A row whose pivot is rounding depends on those before: it is left out, or all such rows would couple.
  const double first = n ? *std::max_element(diagonal.begin(), diagonal.end()) : 0;
  const double nothing = smallest * smallest * first;
  std::vector<std::pair<double, int>> found;
  std::vector<int> left;  // the first rows of the sequence that are left
  SparseRow merged;
  for (auto next = sequence.begin();;) {
    left.erase(std::remove_if(left.begin(), left.end(), [&](int k) { return !(diagonal[k] > nothing); }), left.end());
    for (; next != sequence.end() && static_cast<int>(left.size()) < window; ++next)
      if (diagonal[*next] > nothing) left.push_back(*next);
    if (left.empty()) break;
    double largest = 0;
    for (int k : left) largest = std::max(largest, diagonal[k]);
    // The first of equal ones: symmetric mechanisms have many, and rounding must not decide.
    int p = n;
    for (int k : left)
      if (diagonal[k] > largest * (1 - smallest)) p = std::min(p, k);
    const double pivot = diagonal[p];
    found.emplace_back(pivot, p);
    diagonal[p] = -1;
    for (const auto& [i, x] : S[p]) {
      if (i == p || diagonal[i] <= nothing) continue;
      const double f = x / pivot;
      double own = 0;
      merged.clear();
      auto a = S[i].begin();
      for (const auto& [j, y] : S[p]) {
        for (; a != S[i].end() && a->first < j; ++a) merged.push_back(*a);
        const bool both = a != S[i].end() && a->first == j;
        if (j != p && diagonal[j] > nothing) merged.emplace_back(j, (both ? a->second : 0.0) - f * y);
        if (j == i) own = merged.back().second;
        a += both;
      }
      merged.insert(merged.end(), a, S[i].end());
      S[i].swap(merged);
      diagonal[i] = std::min(diagonal[i], std::max(0.0, own));
    }
    SparseRow().swap(S[p]);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  found.resize(std::min<size_t>(found.size(), count));
  order.clear(), pivots.clear();
  for (const auto& [pivot, p] : found) order.push_back(p), pivots.push_back(std::sqrt(pivot));
}

}  // namespace mbdae
