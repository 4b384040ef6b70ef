// Gauss-Newton projection of positions and velocities in the mass metric.
#include "system/projection.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// x[i] / scales[i].
Vector scaled(const double* x, const std::vector<double>& scales) {
  Vector out(scales.size());
  for (size_t i = 0; i < out.size(); ++i) out[i] = x[i] / scales[i];
  return out;
}

double norm_of(const double* x, const std::vector<double>& scales) {
  double sum = 0;
  for (size_t i = 0; i < scales.size(); ++i) {
    const double component = x[i] / scales[i];
    sum += component * component;
  }
  return std::sqrt(sum);
}

}  // namespace

bool violates_velocity_constraints(const Index2System& s, double t, const double* v) {
  const Tolerances& tolerances = s.tree.tolerances;
  if (s.constraints.drivers.empty()) return false;
  Vector g_t(s.ng, 0.0);
  s.constraints.evaluate_g_t(t, g_t.data());
  if (largest(g_t.data(), s.ng) == 0) return false;
  double violation = 0, terms = 0;
  for (int k = 0; k < s.ng; ++k) {
    double sum = g_t[k], size = std::fabs(g_t[k]);
    const double* G = s.point.G.data() + s.constraints.start[k];
    for (int i : s.constraints.rows[k].columns) sum += *G * v[i], size += std::fabs(*G++ * v[i]);
    violation = std::max(violation, std::fabs(sum) / tolerances.row_scales[k]),
    terms = std::max(terms, size / tolerances.row_scales[k]);
  }
  return !(violation <= tolerances.visible * terms);
}

void add_characteristic_magnitudes(const Index2System& s, const double* y, double* magnitudes) {
  const std::vector<double>& scales = s.tree.tolerances.coordinate_scales;
  const double speed = largest_scaled(y + s.nq, scales);
  for (int i = 0; i < s.nv; ++i) magnitudes[i] += scales[i], magnitudes[s.nv + i] += scales[i] * speed;
}

double largest_move(const Vector& displacement, const Vector& magnitudes, int n, double ratio, double tiny) {
  double largest_ratio = 0;
  for (int k = 0; k < n; ++k)
    largest_ratio = std::max(largest_ratio, std::fabs(displacement[k]) / (ratio * magnitudes[k] + tiny));
  return largest_ratio;
}

bool exceeds_rounding(const Index2System& s, const double* rate, const double* v) {
  const Tolerances& tolerances = s.tree.tolerances;
  return s.constraints.has_sticking_joints ||
         norm_of(rate, tolerances.row_scales) >
             tolerances.sum_rounding * largest_scaled(v, tolerances.coordinate_scales);
}

namespace {

// The minimum-norm x in the mass metric with G x = r (ng,), for r in the range of G: by the rows in use and the banded
// factors of G M^-1 G^T, in linear time; or by all rows and a truncated pseudoinverse, in cubic time, if the rows in
// use do not suffice (close to singular configurations, if velocity rows are in use for q, or if joints stick, whose
// velocity is exactly zero).
class MinimumNormCorrection {
 public:
  explicit MinimumNormCorrection(Index2System& s)
      : s_(s), rows_in_use_suffice_(!s.constraints.has_sticking_joints && s.rows.rank >= 0) {}

  // Compute x; return whether the rows in use were used: if other rows remain violated, call `use_all_rows` and repeat.
  bool compute(const Vector& r, bool of_q, double* x) {
    const bool used_rows_in_use = rows_in_use_suffice_ && !(of_q && has_velocity_rows_in_use()) &&
                                  s_.saddle.factorize_symmetric(smallest_pivot_ratio());
    used_rows_in_use ? s_.saddle.minimum_norm_correction(r.data(), x) : compute_by_all_rows(r, of_q, x);
    return used_rows_in_use;
  }
  void use_all_rows() { rows_in_use_suffice_ = false; }

 private:
  // Few rows: the singular values from which the pseudoinverse of all rows is more accurate than iterations.
  double smallest_pivot_ratio() const {
    const Tolerances& tolerances = s_.tree.tolerances;
    return s_.rows.has_many() ? tolerances.smallest_pivot : tolerances.truncation;
  }
  bool has_velocity_rows_in_use() const {
    const std::vector<int>& rows = s_.rows.in_use();
    return std::any_of(rows.begin(), rows.end(), [&](int k) { return !s_.constraints.rows[k].positional; });
  }
  void compute_by_all_rows(const Vector& r, bool of_q, double* x) {
    const std::vector<double>& scales = s_.tree.tolerances.row_scales;
    Vector rows(s_.constraints.dense(s_.point.Z));
    for (int k : s_.constraints.all) {  // velocity rows do not constrain q
      const double factor = of_q && !s_.constraints.rows[k].positional ? 0 : 1 / scales[k];
      for (int c : s_.constraints.rows[k].columns) rows[static_cast<size_t>(k) * s_.nv + c] *= factor;
    }
    minimum_norm(s_.nv, s_.ng, rows.data(), scaled(r.data(), scales).data(), s_.tree.tolerances.truncation, x);
    s_.point.solve_root_transposed(x);
  }

  Index2System& s_;
  bool rows_in_use_suffice_;
};

// Project q onto g = 0; tight: until |g| no longer halves.
void project_positions(Index2System& s, double t, double* q, bool tight, std::vector<Vector>* path) {
  const Tolerances& tolerances = s.tree.tolerances;
  Configuration& point = s.point;
  MinimumNormCorrection correction(s);
  auto& [g, gap, next_g, rate, x, trial_q] = s.projection;
  g = point.g, next_g.resize(s.ng), x.resize(s.nv), trial_q.resize(s.nq);
  s.constraints.complete_g(t, g.data());
  double displacement = 0;
  bool has_moved = false;
  for (int i = 0; i < tolerances.projection_iterations; ++i) {
    const double norm = norm_of(g.data(), tolerances.row_scales);
    const bool satisfied = norm <= tolerances.sum_rounding * (1 + largest_scaled(q, tolerances.q_scales));
    if (norm == 0 || (satisfied && !tight)) break;
    const bool used_rows_in_use = correction.compute(g, true, x.data());
    displacement = largest_scaled(x.data(), tolerances.coordinate_scales);
    for (double& c : x) c = -c;
    s.manifold.integrate(q, x.data(), trial_q.data());
    s.tree.poses(trial_q.data());
    s.counts.G += 1;
    s.constraints.value(s.tree, trial_q.data(), s.constraints.all, point.scratch_G.data(), next_g.data());
    gap = next_g;
    s.constraints.complete_g(t, gap.data());
    if (!(norm_of(gap.data(), tolerances.row_scales) < tolerances.projection_max_remaining * norm)) {
      if (satisfied || !used_rows_in_use) break;
      correction.use_all_rows();
      continue;
    }
    if (path) path->emplace_back(q, q + s.nq);
    std::copy(trial_q.begin(), trial_q.end(), q);
    g = gap, has_moved = true;
    point.invalidate();  // M remains at the initial q
    std::swap(point.G, point.scratch_G), std::swap(point.g, next_g);
    point.scale_rows(s.constraints.all);
  }
  if (has_moved) point.mark_rows_current(q);
  if (!(norm_of(g.data(), tolerances.row_scales) <= tolerances.projection_open) &&
      !(displacement <= tolerances.projection_stalled * (1 + largest_scaled(q, tolerances.q_scales))))
    throw FallBackToPython();
}

// Project v onto G v + g_t = 0; tight: also if only rounding violates it, and with one step of iterative refinement.
void project_velocities(Index2System& s, double t, double* v, bool tight) {
  const Tolerances& tolerances = s.tree.tolerances;
  MinimumNormCorrection correction(s);
  Vector &rate = s.projection.rate, &x = s.projection.x;
  rate.resize(s.ng), x.resize(s.nv);
  const auto correct = [&]() {
    const bool used_rows_in_use = correction.compute(rate, false, x.data());
    for (int i = 0; i < s.nv; ++i) v[i] -= x[i];
    return used_rows_in_use;
  };
  s.residual_rate(t, v, rate.data());
  if (!tight && !exceeds_rounding(s, rate.data(), v)) return;
  const double initial_norm = norm_of(rate.data(), tolerances.row_scales);
  if (correct()) {
    s.residual_rate(t, v, rate.data());
    const bool reduced =
        norm_of(rate.data(), tolerances.row_scales) < tolerances.projection_max_remaining * initial_norm;
    const bool rows_missing = !reduced && exceeds_rounding(s, rate.data(), v);
    if (rows_missing) correction.use_all_rows();
    if (rows_missing || tight) correct();
  }
  if (violates_velocity_constraints(s, t, v)) throw FallBackToPython();
}

}  // namespace

void project_state(Index2System& s, double t, double* y, bool tight, std::vector<Vector>* path) {
  if (!s.ng) return;
  if (!s.point.is_current(y)) s.point.evaluate(y, true);
  s.counts.state_projections += 1;
  project_positions(s, t, y, tight, path);
  project_velocities(s, t, y + s.nq, tight);
  if (!finite(y, s.length)) throw FallBackToPython();
}

}  // namespace mbdae
