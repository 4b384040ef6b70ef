// The rows of the multipliers mu: independent holonomic rows (mbdae/mechanism/formulations/ggl.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

class PositionRows {
 public:
  explicit PositionRows(Index2System& system);

  void select(const double* y);  // select the rows at the start of a step from y
  // all rows are holonomic: mu has the rows and the Schur complement S of lam
  const bool same_as_velocity_rows;
  const IndependentRows& rows() const { return same_as_velocity_rows ? s_.rows : position_rows_; }
  SaddleSystem& saddle() { return same_as_velocity_rows ? s_.saddle : position_saddle_; }
  const std::vector<int>& in_use() const { return rows().in_use(); }

 private:
  Index2System& s_;
  IndependentRows position_rows_;
  SaddleSystem position_saddle_;
  std::vector<int> all_, order_;  // (p,) holonomic rows, and pivots
  Vector Z_, pivots_;             // workspace of `pivoted_qr`, and (min(nv, p),)
};

}  // namespace mbdae
