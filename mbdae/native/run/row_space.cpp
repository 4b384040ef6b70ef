// Pivoted Gram-Schmidt orthogonalization of rows.
#include "run/row_space.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

RowSpace::RowSpace(const Index2System& s, const Vector& Z, const std::vector<int>& rows)
    : s_(s), Z_(Z), rows_(rows) {
  const int nv = s.nv;
  const Tolerances& tolerances = s.tree.tolerances;
  std::vector<Vector> residuals;
  for (int k : rows) {
    residuals.emplace_back(&Z[static_cast<size_t>(k) * nv], &Z[static_cast<size_t>(k) * nv] + nv);
    for (double& x : residuals.back()) x /= tolerances.row_scales[k];
  }
  double largest_pivot = 0;
  std::vector<int> remaining(rows);
  while (!residuals.empty()) {
    size_t pivot = 0;
    double size = 0;
    for (size_t k = 0; k < residuals.size(); ++k)
      if (const double x = norm(residuals[k].data(), nv); x > size) pivot = k, size = x;
    if (!(size > tolerances.truncation * largest_pivot)) break;
    largest_pivot = std::max(largest_pivot, size);
    Vector q(residuals[pivot]);
    for (int repeat = 0; repeat < 2; ++repeat)  // the second pass removes rounding errors
      for (const Vector& b : basis_) {
        const double component = dot(b.data(), q.data(), nv);
        for (int c = 0; c < nv; ++c) q[c] -= component * b[c];
      }
    const double length = norm(q.data(), nv);
    for (double& x : q) x /= length;
    const double* row = &Z[static_cast<size_t>(remaining[pivot]) * nv];
    basis_.push_back(q), pivots_.push_back(remaining[pivot]), factors_.emplace_back();
    for (const Vector& b : basis_) factors_.back().push_back(dot(b.data(), row, nv));
    residuals.erase(residuals.begin() + pivot), remaining.erase(remaining.begin() + pivot);
    for (Vector& x : residuals) {
      const double component = dot(q.data(), x.data(), nv);
      for (int c = 0; c < nv; ++c) x[c] -= component * q[c];
    }
  }
}

void RowSpace::project_out(Vector& x) const {
  for (int repeat = 0; repeat < 2; ++repeat)
    for (const Vector& b : basis_) {
      const double component = dot(b.data(), x.data(), s_.nv);
      for (int c = 0; c < s_.nv; ++c) x[c] -= component * b[c];
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
  const std::vector<double>& scales = s_.tree.tolerances.row_scales;
  const size_t n = rows_.size(), nv = s_.nv;
  Vector out(s_.ng, 0.0), columns(n * nv), scaled(n);
  for (size_t k = 0; k < n; ++k)
    for (size_t c = 0; c < nv; ++c) columns[c * n + k] = Z_[rows_[k] * nv + c] / scales[rows_[k]];
  if (n)
    minimum_norm(static_cast<int>(n), s_.nv, columns.data(), x.data(), s_.tree.tolerances.truncation, scaled.data());
  for (size_t k = 0; k < n; ++k) out[rows_[k]] = scaled[k] / scales[rows_[k]];
  return out;
}

}  // namespace mbdae
