// The rank and the rows in use at the start of a run (mbdae/mechanism/closures/independent_rows.py).
#include <algorithm>
#include <cmath>

#include "system/independent_rows.hpp"

namespace mbdae {

namespace {

int count_above(const Vector& pivots, double ratio) {
  return static_cast<int>(std::count_if(pivots.begin(), pivots.end(), [&](double x) { return x > ratio * pivots[0]; }));
}

}  // namespace

void IndependentRows::determine(const Vector& G, const Vector& Z, long stamp, const InitialRank& first,
                                const Vector& probe) {
  const int ng = static_cast<int>(position_.size()), max_rank = std::min(nv_, ng);
  if (has_many()) {
    find_pivots(Z, false, max_rank, first.ambiguous, order_, pivots_);
    pivots_stamp_ = -1, rank = static_cast<int>(pivots_.size());
  } else {
    update_pivots(Z, stamp);
    rank = dense_rank(G, first);
  }
  const double ratio = rank ? pivots_[rank - 1] / pivots_[0] : 1;
  floor = rank ? std::min(1.0, first.fallen * ratio) * tolerances_.pivot_rank : 0;
  const bool fell = count_above(pivots_, floor) < rank;
  const bool grew =
      static_cast<int>(pivots_.size()) > rank && pivots_[rank] > tolerances_.growth_tolerance * pivots_[0];
  // Equal pivots of few rows: Python selects, because rounding must not decide.
  if (fell || grew || (!has_many() && has_tie())) rank = -1;
  if (rank < 0) throw FallBackToPython();
  use_first_pivots();
  // If rows omitted by the elimination are not dependent, Python examines them by QR.
  if (has_many() && rank < max_rank &&
      !(remaining_rows_dependent(Z, first.dependent, probe) && remaining_rows_dependent(G, first.dependent, probe))) {
    rank = -1;
    throw FallBackToPython();
  }
  least_pivot_ratio = std::min(least_pivot_ratio, ratio * ratio);
}

bool IndependentRows::has_tie() const {
  const double tie = 1 - std::sqrt(tolerances_.eps);
  const auto entry = [&](int i, int j) { return factors_[static_cast<size_t>(j) * nv_ + i]; };
  for (int j = rank; j < static_cast<int>(position_.size()); ++j) {
    double square = 0;  // squared norm of row j outside the pivots before i
    for (int i = rank; i-- > 0;)
      if (square += entry(i, j) * entry(i, j), square > tie * entry(i, i) * entry(i, i)) return true;
  }
  return false;
}

int IndependentRows::dense_rank(const Vector& entries, const InitialRank& first) {
  const int ng = static_cast<int>(position_.size()), max_rank = std::min(nv_, ng);
  const int r = count_above(pivots_, tolerances_.pivot_rank);
  if (!r || (r == max_rank && pivots_[r - 1] >= first.ambiguous * pivots_[0])) return r;
  // Light bodies connected to heavy ones hide independent rows of G M^-1/2, but not of G with rows of unit length.
  Vector G(constraints_.dense(entries)), row_norms(ng), units, pivots_of_G;
  for (int k = 0; k < ng; ++k) {
    double s = 0;
    for (int c : constraints_.rows[k].columns) s += std::pow(G[static_cast<size_t>(k) * nv_ + c], 2);
    row_norms[k] = std::sqrt(s);
  }
  const double largest = *std::max_element(row_norms.begin(), row_norms.end());
  int n_units = 0;
  for (int k = 0; k < ng; ++k) {
    if (!(row_norms[k] > tolerances_.pivot_rank * largest)) continue;
    const double* row = &G[static_cast<size_t>(k) * nv_];
    for (int c = 0; c < nv_; ++c) units.push_back(row[c] / row_norms[k]);
    ++n_units;
  }
  std::vector<int> order;
  pivoted_qr(nv_, n_units, units, order, pivots_of_G);
  const int geometric_rank = std::max(r, count_above(pivots_of_G, tolerances_.pivot_rank));
  pivoted_qr(nv_, ng, G, order, pivots_of_G);
  const double ratio =
      std::max(pivots_of_G[geometric_rank - 1] / pivots_of_G[0], pivots_[geometric_rank - 1] / pivots_[0]);
  return ratio < first.ambiguous ? -1 : geometric_rank;
}

bool IndependentRows::remaining_rows_dependent(const Vector& B, double tolerance, const Vector& probe) const {
  if (!dependent()) return remaining_.empty();
  const int r = static_cast<int>(rows_.size());
  BandLU S;
  S.resize(r, half_bandwidth_);
  Vector row_norm(position_.size());
  for (int k : constraints_.all) row_norm[k] = std::sqrt(constraints_.product(k, k, B.data()));
  for (int i = 0; i < r; ++i)
    for (int j : coupled_[i])
      S.at(i, j) = S.at(j, i) =
          constraints_.product(rows_[i], rows_[j], B.data()) / (row_norm[rows_[i]] * row_norm[rows_[j]]);
  if (!S.factorize()) return false;
  const double smallest_size = tolerances_.pivot_rank * *std::max_element(row_norm.begin(), row_norm.end());
  for (bool reverse : {false, true}) {
    Vector w(probe), x(r);
    if (reverse) std::reverse(w.begin(), w.end());
    for (int repeat = 0; repeat < 2; ++repeat) {  // the second pass removes rounding errors
      for (int i = 0; i < r; ++i) x[i] = constraints_.times(rows_[i], B, w.data()) / row_norm[rows_[i]];
      S.solve(x.data());
      for (int i = 0; i < r; ++i) {
        const double* entry = B.data() + constraints_.start[rows_[i]];
        for (int c : constraints_.rows[rows_[i]].columns) w[c] -= *entry++ * x[i] / row_norm[rows_[i]];
      }
    }
    for (int k : remaining_)
      if (row_norm[k] > smallest_size && !(std::fabs(constraints_.times(k, B, w.data())) <= tolerance * row_norm[k]))
        return false;
  }
  return true;
}

}  // namespace mbdae
