// The rows of mu: independent ones of those that have a g (mbdae/mechanism/formulations/ggl.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

class PositionRows {
 public:
  explicit PositionRows(Index2System& system);

  void open(const double* y);  // select them at the beginning of a step
  // If all rows have a g they are the rows in use, and S is that of lam.
  const bool shared;
  const IndependentRows& rows() const { return shared ? s_.rows : own_; }
  SaddleSystem& saddle() { return shared ? s_.saddle : own_saddle_; }
  const std::vector<int>& kept() const { return rows().in_use(); }

 private:
  Index2System& s_;
  IndependentRows own_;
  SaddleSystem own_saddle_;
  std::vector<int> all_, order_;  // (p,) rows with a g, and pivots
  Numbers Z_, pivots_, work_;     // (p, nv), (min(nv, p),), scratch
};

}  // namespace mbdae
