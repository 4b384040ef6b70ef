// Sparse factorization of M along the tree, and rows of G M^-1/2.
#include "system/configuration.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

Configuration::Configuration(MultibodyTree& m, Constraints& constraints, Counts& counts)
    : G(constraints.start.back()),
      Z(G.size()),
      g(constraints.rows.size()),
      scratch_G(G.size()),
      m_(m),
      constraints_(constraints),
      counts_(counts),
      q_(m.nq, NAN),
      root_(m.nv),
      x_(m.nv) {
  U_.resize(m.pattern.starts.back());
}

void Configuration::inertia(const double* q) { m_.inertia(q), factorize(); }

void Configuration::dynamics(const double* q, const double* v, bool with_partials) {
  with_partials ? m_.inertia(q, v) : m_.dynamics(q, v);
  factorize();
}

// The ancestors of an ancestor of k follow it in the list of ancestors of k.
void Configuration::factorize() {
  invalidate();
  const size_t* starts = m_.pattern.starts.data();
  const int* rows = m_.pattern.rows.data();
  double* U = U_.data();
  std::copy_n(m_.M(), U_.size(), U);
  for (int k = m_.nv - 1; k >= 0; --k) {
    const double d = U[starts[k]];
    if (!(d > 0) || !std::isfinite(d)) throw FallBackToPython();
    root_[k] = 1 / std::sqrt(d);
    const double inverse = 1 / d;
    const size_t end = starts[k + 1];
    for (size_t i = starts[k] + 1; i < end; ++i) {
      const double u = U[i], a = u * inverse;
      double* target = U + starts[rows[i]];
      *target -= a * u;
      for (size_t j = i + 1; j < end; ++j) *++target -= a * U[j];
      U[i] = a;
    }
  }
}

void Configuration::solve_root(double* x) const {
  const size_t* starts = m_.pattern.starts.data();
  const int* rows = m_.pattern.rows.data();
  for (int k = m_.nv - 1; k >= 0; --k) {
    const double xk = x[k];
    for (size_t i = starts[k] + 1; i < starts[k + 1]; ++i) x[rows[i]] -= U_[i] * xk;
    x[k] = xk * root_[k];
  }
}

void Configuration::solve_root_transposed(double* x) const {
  const size_t* starts = m_.pattern.starts.data();
  const int *rows = m_.pattern.rows.data(), nv = m_.nv;
  for (int k = 0; k < nv; ++k) {
    double s = x[k] * root_[k];
    for (size_t i = starts[k] + 1; i < starts[k + 1]; ++i) s -= U_[i] * x[rows[i]];
    x[k] = s;
  }
}

void Configuration::scale_rows(const std::vector<int>& selected, const Vector& G, Vector& Z) const {
  const size_t* starts = m_.pattern.starts.data();
  const int* rows = m_.pattern.rows.data();
  const double *U = U_.data(), *root = root_.data();
  double* x = x_.data();
  for (int row : selected) {
    const std::vector<int>& columns = constraints_.rows[row].columns;
    double* z = Z.data() + constraints_.start[row];
    constraints_.expand(row, G.data(), x);
    for (size_t j = columns.size(); j-- > 0;) {
      const int k = columns[j];
      const double xk = x[k];
      for (size_t i = starts[k] + 1; i < starts[k + 1]; ++i) x[rows[i]] -= U[i] * xk;
      z[j] = xk * root[k];
    }
  }
}

void Configuration::evaluate(const double* q, bool counted, const double* v) {
  v ? dynamics(q, v, false) : inertia(q);
  constraints_.value(m_, q, constraints_.all, G.data(), g.data());
  scale_rows(constraints_.all);
  if (counted) counts_.M += 1, counts_.factorizations += 1, counts_.G += !g.empty();
  mark_current(q);
}

void Configuration::mark_current(const double* q) {
  mark_rows_current(q);
  current_ = true;
}

void Configuration::mark_rows_current(const double* q) {
  std::copy(q, q + m_.nq, q_.begin());
  rows_current_ = true;
}

bool Configuration::agrees_with(const double* q) const {
  const double tolerance = m_.tolerances.rounding * (1 + largest_scaled(q, m_.tolerances.q_scales));
  for (int i = 0; i < m_.nq; ++i)
    if (!(std::fabs(q[i] - q_[i]) <= tolerance * m_.tolerances.q_scales[i])) return false;  // also if q is not finite
  return true;
}

void Configuration::exchange(Configuration& other) {
  G.swap(other.G), Z.swap(other.Z), g.swap(other.g), q_.swap(other.q_), U_.swap(other.U_), root_.swap(other.root_);
  std::swap(current_, other.current_), std::swap(rows_current_, other.rows_current_);
  stamp_ = other.stamp_ = std::max(stamp_, other.stamp_) + 1;
}

bool Configuration::is_exactly_current(const double* q) const {
  return current_ && std::equal(q, q + m_.nq, q_.begin());
}

}  // namespace mbdae
