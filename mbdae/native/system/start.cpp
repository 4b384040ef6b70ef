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

// Of all rows at the current point, in their units and those of coordinates.
double largest_entry(const Index2System& s) {
  const Tolerances& limits = s.tree.limits;
  double largest = 0;
  for (int k : s.constraints.all) {
    const double* entry = s.point.G.data() + s.constraints.start[k];
    for (int c : s.constraints.rows[k].columns)
      largest = std::max(largest, std::fabs(*entry++) * limits.coordinate_scales[c] / limits.row_scales[k]);
  }
  return largest;
}

}  // namespace

void start(Index2System& s, double t, bool project, const IndependentRows::InitialRank& first, Vector& y, Vector& F,
           Vector& z) {
  try {
    State at;
    at.y = y;
    if (s.ng) {
      if (s.rows.has_many()) s.determine_rows(y.data(), first);  // a projection by these rows takes linear time
      const long stamp = s.point.stamp();
      project_state(s, t, at.y.data());
      const bool moved = !s.point.is_current(at.y.data()) || s.point.stamp() != stamp;
      if (!s.rows.has_many() || moved) s.determine_rows(at.y.data(), first);
      if (largest_entry(s) < first.ambiguous) throw FallBackToPython();  // which looks nearby, see `start` there
      s.counts.state_projections = 0;  // only those of steps are counted
      s.update_independent_rows(t, at);
    } else {
      s.rows.use({}, 0, 0, true);
    }
    if (project) y = at.y;
    at.y = y;
    s.update_independent_rows(t, at);
    y = at.y;
    s.derivative(t, y.data(), F.data(), z.data());
  } catch (const FallBackToPython&) {
    const double accuracy = s.accuracy;
    s.reset(), s.accuracy = accuracy;
    throw;
  }
}

double first_step(Index2System& s, double t, const Vector& y, const Vector& F, const FirstStep& given) {
  const int n = s.controlled_components();
  Vector scale(s.ny), size(s.ny), move(F), next(s.length), change(s.ny), z(s.ng);
  s.component_magnitudes(y.data(), size.data());
  for (int i = 0; i < n; ++i)
    scale[i] = given.atol[given.atol.size() == 1 ? 0 : i] + given.rtol * size[i] + given.tiny;
  const auto norm = [&](const Vector& x) {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += (x[i] / scale[i]) * (x[i] / scale[i]);
    return std::sqrt(sum / n);
  };
  const double d0 = norm(size), d1 = norm(F);
  if (!std::isfinite(d0) || !std::isfinite(d1)) throw FallBackToPython();
  const double usual = std::min(d0, d1) < given.small_norm ? given.default_step : given.change * d0 / d1;
  const double h0 = std::min(usual, given.left);
  if (!(h0 > 0)) return 0;
  for (double& x : move) x *= given.sign * h0;
  s.add(y.data(), move.data(), next.data());
  s.derivative(t + given.sign * h0, next.data(), change.data(), z.data());
  for (int i = 0; i < s.ny; ++i) change[i] -= F[i];
  const double steepest = std::max(d1, norm(change) / h0);
  if (!std::isfinite(steepest)) throw FallBackToPython();
  const double h1 = steepest <= given.zero_change ? std::max(given.default_step, given.reduction * h0)
                                                  : std::pow(given.change / steepest, 1 / given.power);
  return std::min(given.growth * h0, h1);
}

}  // namespace mbdae
