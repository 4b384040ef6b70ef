#include "run/row_space.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

RowSpace::RowSpace(const Index2System& s, const Vector& Z, const std::vector<int>& rows)
    : s_(s), Z_(Z), rows_(rows) {
  const int nv = s.nv;
  const Tolerances& limits = s.tree.limits;
  std::vector<Vector> rest;
  for (int k : rows) {
    rest.emplace_back(&Z[static_cast<size_t>(k) * nv], &Z[static_cast<size_t>(k) * nv] + nv);
    for (double& x : rest.back()) x /= limits.row_scales[k];
  }
  double first = 0;
  std::vector<int> left(rows);
  while (!rest.empty()) {
    size_t best = 0;
    double size = 0;
    for (size_t k = 0; k < rest.size(); ++k)
      if (const double x = norm(rest[k].data(), nv); x > size) best = k, size = x;
    if (!(size > limits.truncation * first)) break;
    first = std::max(first, size);
    Vector q(rest[best]);
    for (int repeat = 0; repeat < 2; ++repeat)  // the second time removes rounding
      for (const Vector& b : basis_) {
        const double along = dot(b.data(), q.data(), nv);
        for (int c = 0; c < nv; ++c) q[c] -= along * b[c];
      }
    const double length = norm(q.data(), nv);
    for (double& x : q) x /= length;
    const double* row = &Z[static_cast<size_t>(left[best]) * nv];
    basis_.push_back(q), pivots_.push_back(left[best]), factors_.emplace_back();
    for (const Vector& b : basis_) factors_.back().push_back(dot(b.data(), row, nv));
    rest.erase(rest.begin() + best), left.erase(left.begin() + best);
    for (Vector& x : rest) {
      const double along = dot(q.data(), x.data(), nv);
      for (int c = 0; c < nv; ++c) x[c] -= along * q[c];
    }
  }
}

void RowSpace::project_out(Vector& x) const {
  for (int repeat = 0; repeat < 2; ++repeat)
    for (const Vector& b : basis_) {
      const double along = dot(b.data(), x.data(), s_.nv);
      for (int c = 0; c < s_.nv; ++c) x[c] -= along * b[c];
    }
}

Vector RowSpace::minimum_norm_correction(const Vector& rates) const {
  Vector out(s_.nv, 0.0), w;
  for (size_t j = 0; j < pivots_.size(); ++j) {
    double x = rates[pivots_[j]];
    for (size_t i = 0; i < j; ++i) x -= factors_[j][i] * w[i];
    w.push_back(x / factors_[j][j]);
    for (int c = 0; c < s_.nv; ++c) out[c] += w[j] * basis_[j][c];
  }
  return out;
}

Vector RowSpace::multipliers(const Vector& x) const {
  const std::vector<double>& scales = s_.tree.limits.row_scales;
  const size_t n = rows_.size(), nv = s_.nv;
  Vector out(s_.ng, 0.0), columns(n * nv), scaled(n);
  for (size_t k = 0; k < n; ++k)
    for (size_t c = 0; c < nv; ++c) columns[c * n + k] = Z_[rows_[k] * nv + c] / scales[rows_[k]];
  if (n) minimum_norm(static_cast<int>(n), s_.nv, columns.data(), x.data(), s_.tree.limits.truncation, scaled.data());
  for (size_t k = 0; k < n; ++k) out[rows_[k]] = scaled[k] / scales[rows_[k]];
  return out;
}

}  // namespace mbdae
