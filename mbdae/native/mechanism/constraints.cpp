// Constraint rows of a mechanism: g, G, Gdot v, products of rows, and drivers.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "mechanism/line_rows.hpp"
#include "mechanism/rows.hpp"
#include "math/vec3.hpp"

namespace mbdae {

Constraints::Constraints(const MultibodyTree& m, std::vector<Row> rows_,
                         const std::vector<std::pair<Anchor, Anchor>>& anchors, std::vector<Driver> drivers_)
    : rows(std::move(rows_)), all(rows.size()), nv(m.nv), start{0}, drivers(std::move(drivers_)) {
  std::iota(all.begin(), all.end(), 0);
  const auto supports = m.supports();
  for (const auto& x : anchors) {
    pairs.emplace_back(x.first, x.second, supports);
    pairs.back().needs_Ra = pairs.back().needs_Rb = false;
  }
  rows_of_pair.resize(pairs.size());
  for (Row& r : rows) {
    if (r.between_joints()) {
      std::set<int> columns;
      std::vector<int> velocities = r.python ? r.python->iv : std::vector<int>();
      for (const RowJoint& j : r.joints) velocities.push_back(j.iv);
      for (int i : velocities) columns.insert(i), columns.insert(m.ancestors[i].begin(), m.ancestors[i].end());
      r.columns.assign(columns.begin(), columns.end());
      for (int i : velocities)
        r.entries.push_back(std::lower_bound(r.columns.begin(), r.columns.end(), i) - r.columns.begin());
      continue;
    }
    rows_of_pair[r.pair].push_back(static_cast<int>(&r - rows.data()));
    Pair& pair = pairs[r.pair];
    r.columns = pair.columns;
    r.columns.erase(std::unique(r.columns.begin(), r.columns.end()), r.columns.end());
    if (r.has_a) pair.needs_Ra = true;
    if (r.has_b) pair.needs_Rb = true;
    if (r.along_line()) pair.needs_Ra = pair.needs_Rb = true;
  }
  for (const Driver& d : drivers)
    if (d.speed) rows[d.row].positional = false;
  for (const Row& r : rows) start.push_back(start.back() + r.columns.size());
}

bool Constraints::has_structure_of(const Constraints& x) const {
  if (x.rows.size() != rows.size() || x.pairs.size() != pairs.size() || x.drivers.size() != drivers.size()) return false;
  for (size_t k = 0; k < pairs.size(); ++k)
    if (x.pairs[k].a.joint != pairs[k].a.joint || x.pairs[k].b.joint != pairs[k].b.joint) return false;
  for (size_t k = 0; k < rows.size(); ++k) {
    const Row &row = rows[k], &other = x.rows[k];
    if (other.kind != row.kind || other.pair != row.pair || other.positional != row.positional ||
        other.columns != row.columns)
      return false;
  }
  return true;
}

void Constraints::write(Constraints x) {
  std::move(x.pairs.begin(), x.pairs.end(), pairs.begin());
  std::move(x.rows.begin(), x.rows.end(), rows.begin());
  drivers = std::move(x.drivers);
}

void Constraints::value(const MultibodyTree& m, const double* q, const std::vector<int>& selected, double* G,
                        double* g) {
  const double* J = m.J();
  for (int r : selected) {
    const Row& row = rows[r];
    double *out = G + start[r], gap = 0;
    if (!inactive.empty() && inactive[r]) {
      std::fill_n(out, row.columns.size(), 0.0);
    } else if (row.between_joints()) {
      gap = row.coordinate_entries(q, out);
    } else {
      Pair& pair = pairs[row.pair];
      pair.update_poses(m);
      double w[6];
      gap = row.wrench(pair, w);
      const double* sign = pair.sign.data();
      const int *source = pair.sources.data(), n = static_cast<int>(pair.sources.size());
      const auto entry = [&](int k) { return sign[k] == 0 ? 0 : sign[k] * dot6(w, J + 6 * source[k]); };
      for (int k = 0; k < n && !pair.has_repeated_columns; ++k) out[k] = entry(k);
      for (int k = 0; k < n && pair.has_repeated_columns; ++k) {
        const bool repeated = k && pair.columns[k - 1] == pair.columns[k];
        repeated ? out[-1] += entry(k) : *out++ = entry(k);
      }
    }
    if (g) g[r] = row.positional ? gap : 0;
  }
}

void Constraints::dense_value(const MultibodyTree& m, const double* q, const std::vector<int>& selected, Vector& G,
                              double* g) {
  G.resize(rows.size() * nv), entries_.resize(start.back());
  value(m, q, selected, entries_.data(), g);
  for (int r : selected) expand(r, entries_.data(), &G[r * nv]);
}

Vector Constraints::dense(const Vector& entries) const {
  Vector out;
  return dense(all, entries, out), out;
}

void Constraints::dense(const std::vector<int>& selected, const Vector& entries, Vector& out) const {
  out.assign(selected.size() * nv, 0.0);
  for (size_t i = 0; i < selected.size(); ++i) expand(selected[i], entries.data(), &out[i * nv]);
}

std::vector<Constraints::CommonRun> Constraints::common(int k, int l) const {
  const std::vector<int>&a = rows[k].columns, &b = rows[l].columns;
  std::vector<CommonRun> out;
  for (size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i] == b[j]) {
      const CommonRun* last = out.empty() ? nullptr : &out.back();
      if (!last || last->k + last->n != static_cast<int>(i) || last->l + last->n != static_cast<int>(j))
        out.push_back({static_cast<int>(i), static_cast<int>(j), 0});
      ++out.back().n;
    }
    const bool next_a = a[i] <= b[j], next_b = b[j] <= a[i];
    i += next_a, j += next_b;
  }
  return out;
}

double Constraints::product(int k, int l, const double* entries) const {
  const std::vector<int>&a = rows[k].columns, &b = rows[l].columns;
  const double *x = entries + start[k], *y = entries + start[l];
  if (rows[k].pair >= 0 && rows[k].pair == rows[l].pair) return dot(x, y, static_cast<int>(a.size()));
  double sum = 0;
  for (size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i] == b[j]) sum += x[i] * y[j];
    const bool next_a = a[i] <= b[j], next_b = b[j] <= a[i];
    i += next_a, j += next_b;
  }
  return sum;
}

void Constraints::complete_g(double t, double* g) const {
  for (const Driver& d : drivers) {
    double u[3];
    motion(t, d, u);
    g[d.row] -= u[0];
  }
  for (size_t r = 0; r < rows.size(); ++r)
    if (rows[r].period > 0 && rows[r].positional) g[r] -= rows[r].period * std::nearbyint(g[r] / rows[r].period);
}

void Constraints::bias(const MultibodyTree& m, const double* q, const double* v, const std::vector<int>& selected,
                       double* out, bool minus_gravity) {
  int current_pair = -1;
  for (int r : selected) {
    const Row& row = rows[r];
    if (!inactive.empty() && inactive[r]) {
      out[r] = 0;
      continue;
    }
    if (row.between_joints()) {
      out[r] = row.coordinate_bias(q, v);
      continue;
    }
    Pair& pair = pairs[row.pair];
    if (row.pair != current_pair)
      pair.update_poses(m), pair.update_velocities(m, minus_gravity), current_pair = row.pair;
    out[r] = row.rate(pair);
  }
}

void Constraints::motion(double t, const Driver& d, double* u) const {
  for (int k = 0; k < 3; ++k) {
    u[k] = !d.speed ? d.motion.at(t, k) : k ? d.motion.at(t, k - 1) : 0;
    if (!std::isfinite(u[k])) throw FallBackToPython();
  }
  if (d.length && !(u[0] > 0)) throw FallBackToPython();
}

void Constraints::evaluate_g_t(double t, double* out) const {
  for (const Driver& d : drivers) {
    double u[3];
    motion(t, d, u);
    out[d.row] = -u[1];
  }
}

void Constraints::evaluate_g_tt(double t, double* out) const {
  for (const Driver& d : drivers) {
    double u[3];
    motion(t, d, u);
    out[d.row] = -u[2];
  }
}

}  // namespace mbdae
