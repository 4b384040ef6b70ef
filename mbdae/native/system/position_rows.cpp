// Independent rows of the positional constraints, for mu.
#include "system/position_rows.hpp"

#include <algorithm>

namespace mbdae {

namespace {

std::vector<int> positional_rows(const Constraints& constraints) {
  std::vector<int> out;
  for (int k : constraints.all)
    if (constraints.rows[k].positional) out.push_back(k);
  return out;
}

}  // namespace

PositionRows::PositionRows(Index2System& s)
    : same_as_velocity_rows(positional_rows(s.constraints).size() == s.constraints.all.size()),
      s_(s),
      position_rows_(s.constraints, s.constraints.all, s.nv, s.tree.tolerances, true),
      position_saddle_(s.point, s.constraints, position_rows_, s.tree.tolerances, s.counts, s.nv),
      all_(positional_rows(s.constraints)) {}

void PositionRows::select(const double* y) {
  if (same_as_velocity_rows) return;
  if (!s_.point.is_current(y)) s_.point.evaluate(y, true);
  s_.constraints.dense(all_, s_.point.Z, Z_);
  pivoted_qr(s_.nv, static_cast<int>(all_.size()), Z_, order_, pivots_);
  if (position_rows_.rank < 0) {
    const double threshold = pivots_.empty() ? 0 : s_.tree.tolerances.pivot_rank * pivots_[0];
    position_rows_.rank =
        static_cast<int>(std::count_if(pivots_.begin(), pivots_.end(), [&](double x) { return x > threshold; }));
  }
  std::vector<int> selected;
  for (int i = 0; i < position_rows_.rank; ++i) selected.push_back(all_[order_[i]]);
  std::sort(selected.begin(), selected.end());
  position_rows_.use(selected, position_rows_.rank, 0, true);
}

}  // namespace mbdae
