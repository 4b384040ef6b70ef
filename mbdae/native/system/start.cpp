// Rank, projection and first derivative at the start of a run; Hairer's first step size.
#include "system/start.hpp"

#include <algorithm>
#include <cmath>

#include "system/projection.hpp"

namespace mbdae {

void Index2System::determine_rows(const double* q, const IndependentRows::InitialRank& first) {
  if (!point.is_current(q)) point.evaluate(q, true);
  rows.determine(point.G, point.Z, point.stamp(), first, probe_);
  rows.frozen = true;
}

bool Index2System::remaining_rows_dependent(const double* q, double tolerance) {
  if (!point.is_current(q)) point.evaluate(q, false);
  return rows.remaining_rows_dependent(point.Z, tolerance, probe_);
}

namespace {

// The largest entry of G of all rows at the current point, in scaled rows and coordinates.
double largest_entry(const Index2System& s) {
  const Tolerances& tolerances = s.tree.tolerances;
  double largest = 0;
  for (int k : s.constraints.all) {
    const double* entry = s.point.G.data() + s.constraints.start[k];
    for (int c : s.constraints.rows[k].columns)
      largest = std::max(largest, std::fabs(*entry++) * tolerances.coordinate_scales[c] / tolerances.row_scales[k]);
  }
  return largest;
}

}  // namespace

void start(Index2System& s, double t, bool project, const IndependentRows::InitialRank& first, Vector& y, Vector& F,
           Vector& z) {
  try {
    State state;
    state.y = y;
    if (s.ng) {
      if (s.rows.has_many()) s.determine_rows(y.data(), first);  // so that the projection takes linear time
      const long stamp = s.point.stamp();
      project_state(s, t, state.y.data());
      const bool has_moved = !s.point.is_current(state.y.data()) || s.point.stamp() != stamp;
      if (!s.rows.has_many() || has_moved) s.determine_rows(state.y.data(), first);
      // Python tests perturbed points, see `start` in Python
      if (largest_entry(s) < first.ambiguous) throw FallBackToPython();
      s.counts.state_projections = 0;  // count only those of steps
      s.update_independent_rows(t, state);
    } else {
      s.rows.use({}, 0, 0, true);
    }
    if (project) y = state.y;
    state.y = y;
    s.update_independent_rows(t, state);
    y = state.y;
    s.derivative(t, y.data(), F.data(), z.data());
  } catch (const FallBackToPython&) {
    const double accuracy = s.accuracy;
    s.reset(), s.accuracy = accuracy;
    throw;
  }
}

double first_step(Index2System& s, double t, const Vector& y, const Vector& F, const FirstStep& settings) {
  const int n = s.controlled_components();
  Vector scale(s.ny), size(s.ny), displacement(F), next(s.length), change(s.ny), z(s.ng);
  s.component_magnitudes(y.data(), size.data());
  for (int i = 0; i < n; ++i)
    scale[i] = settings.atol[settings.atol.size() == 1 ? 0 : i] + settings.rtol * size[i] + settings.tiny;
  const auto norm = [&](const Vector& x) {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += (x[i] / scale[i]) * (x[i] / scale[i]);
    return std::sqrt(sum / n);
  };
  const double d0 = norm(size), d1 = norm(F);
  if (!std::isfinite(d0) || !std::isfinite(d1)) throw FallBackToPython();
  const double initial_step =
      std::min(d0, d1) < settings.small_norm ? settings.default_step : settings.change * d0 / d1;
  const double h0 = std::min(initial_step, settings.left);
  if (!(h0 > 0)) return 0;
  for (double& x : displacement) x *= settings.sign * h0;
  s.add(y.data(), displacement.data(), next.data());
  s.derivative(t + settings.sign * h0, next.data(), change.data(), z.data());
  for (int i = 0; i < s.ny; ++i) change[i] -= F[i];
  const double largest_derivative = std::max(d1, norm(change) / h0);
  if (!std::isfinite(largest_derivative)) throw FallBackToPython();
  const double h1 = largest_derivative <= settings.zero_change
                        ? std::max(settings.default_step, settings.reduction * h0)
                        : std::pow(settings.change / largest_derivative, 1 / settings.power);
  return std::min(settings.growth * h0, h1);
}

}  // namespace mbdae
