#include "math/sparse_pivots.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

void sparse_pivots(std::vector<SparseRow>& S, int count, double smallest, std::vector<int>& order, Numbers& pivots) {
  const int n = static_cast<int>(S.size());
  Numbers diagonal(n);  // -1: eliminated
  for (int i = 0; i < n; ++i)
    for (const auto& [j, x] : S[i])
      if (j == i) diagonal[i] = x;
  order.clear(), pivots.clear();
  // A row whose pivot is rounding depends on those before: it is left out, or all such rows would couple.
  const double first = n ? *std::max_element(diagonal.begin(), diagonal.end()) : 0;
  const double nothing = smallest * smallest * first;
  SparseRow merged;
  for (int k = 0; k < std::min(count, n); ++k) {
    const double largest = *std::max_element(diagonal.begin(), diagonal.end());
    if (!(largest > nothing)) return;
    // The first of equal ones: symmetric mechanisms have many, and rounding must not decide.
    const int p = static_cast<int>(std::find_if(diagonal.begin(), diagonal.end(), [&](double x) {
                    return x > largest * (1 - smallest);
                  }) - diagonal.begin());
    const double pivot = diagonal[p];
    order.push_back(p), pivots.push_back(std::sqrt(pivot));
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
}

}  // namespace mbdae
