// The rows in use: independent rows, selected again when they become worse conditioned than others
// (mbdae/mechanism/closures/independent_rows.py).
#pragma once

#include <cmath>
#include <vector>

#include "math/sparse_pivots.hpp"
#include "mechanism/rows.hpp"

namespace mbdae {

// Of independent rows, also relative to the largest pivot; 0 where they are dependent.
struct SmallestPivot {
  double size = INFINITY, ratio = 1;  // without rows
};

class IndependentRows {
 public:
  // Of all rows; or of those only that have a g.
  IndependentRows(const Constraints& constraints, std::vector<int> elimination, int nv, const Tolerances& limits,
                  bool positions = false);

  int rank = -1;           // -1: unknown
  double floor = 0;        // ratio of pivots below which the rank has fallen
  bool frozen = false;     // the rows in use are fixed, except in `update_independent_rows`
  double least_pivot_ratio = 1;      // smallest ratio of pivots of G M^-1 G^T since the last check in Python
  bool others_independent = false;   // rows not in use may be independent of the rows in use

  const std::vector<int>& neighbours(int row) const { return neighbours_[row]; }  // with a column in common, sorted
  const std::vector<int>& in_use() const { return rows_; }                        // (r,) in the order of elimination
  // Positions of the rows in use with a column in common with the one at a position, up to it, in order.
  const std::vector<int>& coupled(int position) const { return coupled_[position]; }
  const std::vector<int>& others() const { return others_; }                      // (ng - r,) sorted
  const std::vector<int>& position() const { return position_; }  // (ng,) in the saddle system; -1 where not in use
  int half_bandwidth() const { return half_bandwidth_; }          // of the saddle system
  long version() const { return version_; }                       // counts changes of the rows in use
  bool dependent() const { return !others_.empty() && !rows_.empty(); }
  bool has_many() const { return static_cast<int>(position_.size()) > limits_.many_rows; }

  void use(const std::vector<int>& rows, int rank, double floor, bool frozen);
  void reset();  // as when new
  void record_ratio(double ratio);  // note the pivot ratio of a saddle-point system
  // Determine rank, floor and rows at the start of a run from G and Z (entries by rows), as `initial_rank` and `select_rows` in Python;
  // where Python must decide, as next to singular configurations, `FallBackToPython`.
  struct InitialRank {
    double ambiguous;  // ratio of pivots below which no smooth interval begins
    double fallen;     // of the ratio of pivots at the start: still small below this multiple
    double dependent;  // of the largest row of many: its part outside the rows in use
  };
  void determine(const Vector& G, const Vector& Z, long stamp, const InitialRank& first, const Vector& probe);
  // Is a vector in the null space of the rows in use, from one in general position (nv,) and its reverse, also one of all
  // rows? To a tolerance of their length; negligible rows are ignored. B: G or Z.
  bool remaining_rows_dependent(const Vector& B, double tolerance, const Vector& probe) const;
  // From Z (ng, nv), the rows of G M^-1/2: select again; returns whether the rows in use changed. stamp: changes with
  // Z.
  bool select(const Vector& Z, long stamp);
  // At the beginning of a step: always for few rows, for a reason for many rows.
  bool select_if_triggered(const Vector& Z, long stamp);
  // Is the factor R of Z^T P = Q R of the selection also a factor of Z Z^T of the rows in use? Then it is current.
  bool factorize(const Vector& Z, long stamp);
  void solve(double* x) const;  // with it, (r,) by position: x := (Z Z^T)^-1 x
  // Smallest of this many pivots of all rows to the largest: many rows by sparse elimination.
  SmallestPivot smallest_pivot(const Vector& Z, int rank);

  class Freeze;  // while it exists, the rows in use are fixed, and solves are not part of the run

 private:
  void set(std::vector<int> rows);
  void update_pivots(const Vector& Z, long stamp);  // pivots and factors of all rows, for this Z
  // Z Z^T of all rows, or of those in use by their position.
  std::vector<SparseRow> products(const Vector& Z, bool of_rows_in_use) const;
  // Pivots of many rows, of all or of those in use (then by position), see `sparse_pivots`.
  void find_pivots(const Vector& Z, bool of_rows_in_use, int count, double smallest, std::vector<int>& order,
                   Vector& pivots) const;
  double smallest_pivot_in_use(const Vector& Z);
  bool uses_first_pivots() const;  // are those of the first `rank` pivots in use?
  bool use_first_pivots();  // use those of the first `rank` pivots; whether they are others
  bool has_tie() const;  // has a dependent row a pivot of a row in use, up to rounding, in `factors_`?
  int dense_rank(const Vector& G, const InitialRank& first);

  const Constraints& constraints_;
  const Tolerances& limits_;
  const int nv_;
  const std::vector<int> elimination_;         // (ng,) of each row in the order of elimination
  int window_ = 0;                             // of rows among which pivots are chosen
  std::vector<std::vector<int>> neighbours_;   // (ng,)
  std::vector<bool> excluded_;                 // (ng,)
  std::vector<int> rows_, others_, position_;  // (r,), (ng - r,), (ng,)
  std::vector<std::vector<int>> coupled_;      // (r,)
  int half_bandwidth_ = 0;
  long version_ = 0;
  double best_ratio_ = 0,
         last_ratio_ = NAN;  // ratios of pivots: best since the last examination, and last; nan: no solve since
  std::vector<int> order_, order_in_use_;      // (ng,), (r,) of pivots
  Vector pivots_, pivots_in_use_;              // (min(nv, ng),), (min(nv, r),)
  Vector factors_, work_;  // (ng, nv) and more: R by columns, as `pivoted_qr` leaves it, of few rows; and scratch
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
