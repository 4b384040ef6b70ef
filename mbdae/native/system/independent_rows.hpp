// The rows in use: independent rows, reselected when other rows are better conditioned
// (mbdae/mechanism/closures/independent_rows.py).
#pragma once

#include <cmath>
#include <vector>

#include "math/sparse_pivots.hpp"
#include "mechanism/rows.hpp"

namespace mbdae {

// The smallest pivot of independent rows, and its ratio to the largest pivot; 0 if they are dependent.
struct SmallestPivot {
  double size = INFINITY, ratio = 1;  // values without rows
};

class IndependentRows {
 public:
  // positions: only of rows that constrain positions.
  IndependentRows(const Constraints& constraints, std::vector<int> elimination, int nv, const Tolerances& tolerances,
                  bool positions = false);

  int rank = -1;           // -1: unknown
  double floor = 0;        // pivot ratio below which the rank has fallen
  bool frozen = false;     // the rows in use change only in `update_independent_rows`
  double least_pivot_ratio = 1;        // smallest pivot ratio of G M^-1 G^T since the last check in Python
  bool remaining_independent = false;  // remaining rows may be independent of the rows in use

  const std::vector<int>& neighbours(int row) const { return neighbours_[row]; }  // rows with a common column, sorted
  const std::vector<int>& in_use() const { return rows_; }                        // (r,) in the order of elimination
  // Sorted positions, up to this one, of the rows in use that have a column in common with the row at this position.
  const std::vector<int>& coupled(int position) const { return coupled_[position]; }
  // (ng - r,) rows not in use, sorted
  const std::vector<int>& remaining() const { return remaining_; }
  const std::vector<int>& position() const { return position_; }  // (ng,) in the saddle system; -1: not in use
  int half_bandwidth() const { return half_bandwidth_; }          // of the saddle system
  long version() const { return version_; }                       // counts changes of the rows in use
  bool dependent() const { return !remaining_.empty() && !rows_.empty(); }
  bool has_many() const { return static_cast<int>(position_.size()) > tolerances_.many_rows; }

  void use(const std::vector<int>& rows, int rank, double floor, bool frozen);
  void reset();                     // to the initial state
  void record_ratio(double ratio);  // record the pivot ratio of a saddle-point system
  // Determine rank, floor and rows at the start of a run from G and Z (entries by rows), as `initial_rank` and
  // `select_rows` in Python; FallBackToPython if Python must decide, for example close to singular configurations.
  struct InitialRank {
    double ambiguous;  // pivot ratio below which no smooth interval begins
    double fallen;     // factor of the pivot ratio at the start, up to which ratios are small
    double dependent;  // largest component of many rows outside the rows in use, relative to their length
  };
  void determine(const Vector& G, const Vector& Z, long stamp, const InitialRank& first, const Vector& probe);
  // Whether vectors in the null space of the rows in use, from a probe (nv,) in general position and its reverse, are
  // also in the null space of all rows, to a tolerance relative to their length; negligible rows are ignored. B: G or
  // Z.
  bool remaining_rows_dependent(const Vector& B, double tolerance, const Vector& probe) const;
  // Select rows from Z (ng, nv), the rows of G M^-1/2; return whether the rows in use changed. stamp: identifies Z.
  bool select(const Vector& Z, long stamp);
  // Select rows at the start of a step; many rows only if their conditioning requires it.
  bool select_if_triggered(const Vector& Z, long stamp);
  // Whether the factor R of Z^T P = Q R of the selection is also a factor of Z Z^T of the rows in use; then it is
  // current.
  bool factorize(const Vector& Z, long stamp);
  void solve(double* x) const;  // with this factor: x := (Z Z^T)^-1 x, (r,) by position
  // Up to `count` independent rows in the order of elimination, with pivots above `smallest_ratio` times the largest,
  // by sparse elimination, accurate to the square root of rounding; the rows in use remain.
  std::vector<int> independent(const Vector& Z, int count, double smallest_ratio);
  // The smallest of the first `rank` pivots of all rows; of many rows by sparse elimination.
  SmallestPivot smallest_pivot(const Vector& Z, int rank);

  class Freeze;  // fixes the rows in use for its lifetime, and does not record pivot ratios

 private:
  void set(std::vector<int> rows);
  void update_pivots(const Vector& Z, long stamp);  // pivots and factors of all rows
  // Z Z^T of all rows, or of the rows in use by position.
  std::vector<SparseRow> products(const Vector& Z, bool of_rows_in_use) const;
  // Pivots of all rows, or of the rows in use by position, see `sparse_pivots`.
  void find_pivots(const Vector& Z, bool of_rows_in_use, int count, double smallest, std::vector<int>& order,
                   Vector& pivots) const;
  double smallest_pivot_in_use(const Vector& Z);
  bool uses_first_pivots() const;  // whether the rows of the first `rank` pivots are in use
  bool use_first_pivots();         // use these rows; return whether the rows in use changed
  std::vector<int> first_pivots(int count) const;  // rows of the first pivots, in the order of elimination
  bool has_tie() const;            // whether a dependent row ties with a pivot, to rounding, in `factors_`
  int dense_rank(const Vector& G, const InitialRank& first);

  const Constraints& constraints_;
  const Tolerances& tolerances_;
  const int nv_;
  const std::vector<int> elimination_;         // (ng,) position of each row in the order of elimination
  int window_ = 0;                             // number of rows among which pivots are chosen
  std::vector<std::vector<int>> neighbours_;   // (ng,)
  std::vector<bool> excluded_;                 // (ng,)
  std::vector<int> rows_, remaining_, position_;  // (r,), (ng - r,), (ng,)
  std::vector<std::vector<int>> coupled_;      // (r,)
  int half_bandwidth_ = 0;
  long version_ = 0;
  double best_ratio_ = 0,
         last_ratio_ = NAN;  // pivot ratios: best since the last selection, and last; nan: no solve since then
  std::vector<int> order_, order_in_use_;      // (ng,), (r,) of pivots
  Vector pivots_, pivots_in_use_;              // (min(nv, ng),), (min(nv, r),)
  Vector factors_, work_;  // (ng, nv) and more: R of few rows by columns, as in `pivoted_qr`; scratch
  mutable Vector x_;       // (r,) in the order of pivots
  long pivots_stamp_ = -1;                     // the stamp of the Z whose pivots and factors are current
};

class IndependentRows::Freeze {
 public:
  explicit Freeze(IndependentRows& rows)
      : rows_(rows),
        frozen_(rows.frozen),
        least_ratio_(rows.least_pivot_ratio),
        best_ratio_(rows.best_ratio_),
        last_ratio_(rows.last_ratio_) {
    rows.frozen = true;
  }
  ~Freeze() {
    rows_.frozen = frozen_, rows_.least_pivot_ratio = least_ratio_, rows_.best_ratio_ = best_ratio_,
    rows_.last_ratio_ = last_ratio_;
  }
  Freeze(const Freeze&) = delete;

 private:
  IndependentRows& rows_;
  const bool frozen_;
  const double least_ratio_, best_ratio_, last_ratio_;
};

}  // namespace mbdae
