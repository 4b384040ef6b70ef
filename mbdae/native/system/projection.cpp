#include "system/projection.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// Scaled values: lengths in characteristic lengths of the mechanism.
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
  const Tolerances& limits = s.tree.limits;
  if (s.constraints.drivers.empty()) return false;
  Vector g_t(s.ng, 0.0);
  s.constraints.evaluate_g_t(t, g_t.data());
  if (largest(g_t.data(), s.ng) == 0) return false;
  double violation = 0, terms = 0;
  for (int k = 0; k < s.ng; ++k) {
    double sum = g_t[k], size = std::fabs(g_t[k]);
    const double* G = s.point.G.data() + s.constraints.start[k];
    for (int i : s.constraints.rows[k].columns) sum += *G * v[i], size += std::fabs(*G++ * v[i]);
    violation = std::max(violation, std::fabs(sum) / limits.row_scales[k]), terms = std::max(terms, size / limits.row_scales[k]);
  }
  return !(violation <= limits.visible * terms);
}

void add_characteristic_magnitudes(const Index2System& s, const double* y, double* magnitudes) {
  const std::vector<double>& scales = s.tree.limits.coordinate_scales;
  const double speed = largest_scaled(y + s.nq, scales);
  for (int i = 0; i < s.nv; ++i) magnitudes[i] += scales[i], magnitudes[s.nv + i] += scales[i] * speed;
}

double largest_move(const Vector& move, const Vector& magnitudes, int measured, double ratio, double tiny) {
  double most = 0;
  for (int k = 0; k < measured; ++k) most = std::max(most, std::fabs(move[k]) / (ratio * magnitudes[k] + tiny));
  return most;
}

bool exceeds_rounding(const Index2System& s, const double* rate, const double* v) {
  const Tolerances& limits = s.tree.limits;
  return s.constraints.has_sticking_joints ||
         norm_of(rate, limits.row_scales) > limits.sum_rounding * largest_scaled(v, limits.coordinate_scales);
}

namespace {

// x of least |x| in the mass metric with G x = r (ng,), for r in the range of G: by the rows in use and the band
// factors of G M^-1 G^T, in linear time, unless these do not suffice (near singular configurations, where rows of
// velocity take part in q, or where joints stick, whose speed is exactly zero); or by all rows, with a truncated
// pseudoinverse, in cubic time.
class MinimumNormCorrection {
 public:
  explicit MinimumNormCorrection(Index2System& s)
      : s_(s), suffices_(!s.constraints.has_sticking_joints && s.rows.rank >= 0) {}

  // Returns whether it is by the rows in use: if these leave rows open, `insufficient`, and again.
  bool find(const Vector& r, bool of_q, double* x) {
    const bool by_rows_in_use =
        suffices_ && !(of_q && rolls()) && s_.saddle.factorize_symmetric(s_.tree.limits.truncation);
    by_rows_in_use ? s_.saddle.minimum_norm_correction(r.data(), x) : over_all(r, of_q, x);
    return by_rows_in_use;
  }
  void insufficient() { suffices_ = false; }

 private:
  bool rolls() const {  // is a velocity row in use?
    const std::vector<int>& rows = s_.rows.in_use();
    return std::any_of(rows.begin(), rows.end(), [&](int k) { return !s_.constraints.rows[k].positional; });
  }
  void over_all(const Vector& r, bool of_q, double* x) {
    const std::vector<double>& scales = s_.tree.limits.row_scales;
    Vector rows(s_.constraints.dense(s_.point.Z));
    for (int k : s_.constraints.all) {  // velocity rows do not constrain q
      const double by = of_q && !s_.constraints.rows[k].positional ? 0 : 1 / scales[k];
      for (int c : s_.constraints.rows[k].columns) rows[static_cast<size_t>(k) * s_.nv + c] *= by;
    }
    minimum_norm(s_.nv, s_.ng, rows.data(), scaled(r.data(), scales).data(), s_.tree.limits.truncation, x);
    s_.point.solve_root_transposed(x);
  }

  Index2System& s_;
  bool suffices_;
};

// q becomes the nearest point with g = 0.
void project_positions(Index2System& s, double t, double* q, std::vector<Vector>* path) {
  const Tolerances& limits = s.tree.limits;
  Configuration& point = s.point;
  MinimumNormCorrection correction(s);
  auto& [g, gap, next_g, rate, x, nearer] = s.projection;
  g = point.g, next_g.resize(s.ng), x.resize(s.nv), nearer.resize(s.nq);
  s.constraints.complete_g(t, g.data());
  double move = 0;
  bool moved = false;
  for (int i = 0; i < limits.projection_iterations; ++i) {
    if (norm_of(g.data(), limits.row_scales) <= limits.sum_rounding * (1 + largest_scaled(q, limits.q_scales))) break;
    const bool by_rows_in_use = correction.find(g, true, x.data());
    move = largest_scaled(x.data(), limits.coordinate_scales);
    for (double& c : x) c = -c;
    s.manifold.integrate(q, x.data(), nearer.data());
    s.tree.poses(nearer.data());
    s.counts.G += 1;
    s.constraints.value(s.tree, nearer.data(), s.constraints.all, point.scratch_G.data(), next_g.data());
    gap = next_g;
    s.constraints.complete_g(t, gap.data());
    if (!(norm_of(gap.data(), limits.row_scales) <
          limits.projection_max_remaining * norm_of(g.data(), limits.row_scales))) {
      if (!by_rows_in_use) break;
      correction.insufficient();
      continue;
    }
    if (path) path->emplace_back(q, q + s.nq);
    std::copy(nearer.begin(), nearer.end(), q);
    g = gap, moved = true;
    point.invalidate();  // M remains that of the start
    std::swap(point.G, point.scratch_G), std::swap(point.g, next_g);
    point.scale_rows(s.constraints.all);
  }
  if (moved) point.mark_rows_current(q);
  if (!(norm_of(g.data(), limits.row_scales) <= limits.projection_open) &&
      !(move <= limits.projection_stalled * (1 + largest_scaled(q, limits.q_scales))))
    throw FallBackToPython();
}

// v becomes the nearest one with G v + g_t = 0.
void project_velocities(Index2System& s, double t, double* v) {
  const Tolerances& limits = s.tree.limits;
  MinimumNormCorrection correction(s);
  Vector &rate = s.projection.rate, &x = s.projection.x;
  rate.resize(s.ng), x.resize(s.nv);
  const auto correct = [&]() {
    const bool by_rows_in_use = correction.find(rate, false, x.data());
    for (int i = 0; i < s.nv; ++i) v[i] -= x[i];
    return by_rows_in_use;
  };
  s.residual_rate(t, v, rate.data());
  if (!exceeds_rounding(s, rate.data(), v)) return;
  const double before = norm_of(rate.data(), limits.row_scales);
  if (correct()) {
    s.residual_rate(t, v, rate.data());
    const bool closed = norm_of(rate.data(), limits.row_scales) < limits.projection_max_remaining * before;
    if (!closed && exceeds_rounding(s, rate.data(), v)) correction.insufficient(), correct();
  }
  if (violates_velocity_constraints(s, t, v)) throw FallBackToPython();
}

}  // namespace

void project_state(Index2System& s, double t, double* y, std::vector<Vector>* path) {
  if (!s.ng) return;
  if (!s.point.is_current(y)) s.point.evaluate(y, true);
  s.counts.state_projections += 1;
  project_positions(s, t, y, path);
  project_velocities(s, t, y + s.nq);
  if (!finite(y, s.length)) throw FallBackToPython();
}

}  // namespace mbdae
