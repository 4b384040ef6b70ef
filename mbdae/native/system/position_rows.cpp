#include "system/position_rows.hpp"

#include <algorithm>

namespace mbdae {

namespace {

std::vector<int> with_a_g(const Constraints& constraints) {
  std::vector<int> out;
  for (int k : constraints.all)
    if (constraints.rows[k].positional) out.push_back(k);
  return out;
}

}  // namespace

PositionRows::PositionRows(Index2System& s)
    : shared(with_a_g(s.constraints).size() == s.constraints.all.size()),
      s_(s),
      own_(s.constraints, s.constraints.all, s.nv, s.mechanics.limits, true),
      own_saddle_(s.point, s.constraints, own_, s.mechanics.limits, s.counts, s.nv),
      all_(with_a_g(s.constraints)) {}

void PositionRows::open(const double* y) {
  if (shared) return;
  if (!s_.point.near(y)) s_.point.evaluate(y, true);
  const size_t nv = s_.nv;
  Z_.resize(all_.size() * nv);
  for (size_t i = 0; i < all_.size(); ++i) std::copy_n(&s_.point.Z[all_[i] * nv], nv, &Z_[i * nv]);
  pivots(s_.nv, static_cast<int>(all_.size()), Z_.data(), order_, pivots_, work_);
  if (own_.rank < 0) {
    const double least = pivots_.empty() ? 0 : s_.mechanics.limits.pivot_rank * pivots_[0];
    own_.rank = static_cast<int>(std::count_if(pivots_.begin(), pivots_.end(), [&](double x) { return x > least; }));
  }
  std::vector<int> kept;
  for (int i = 0; i < own_.rank; ++i) kept.push_back(all_[order_[i]]);
  std::sort(kept.begin(), kept.end());
  own_.use(kept, own_.rank, 0, true);
}

}  // namespace mbdae
