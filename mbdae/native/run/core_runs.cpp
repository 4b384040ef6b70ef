// Runs in the core without Python, from their start to their end.
#include "run/core_runs.hpp"

#include <algorithm>
#include <cmath>

#include "system/residuals.hpp"

namespace mbdae {

namespace {

// Take all steps to the end; false if Python must take one.
bool take_all_steps(Method& method, Index2System& s, long max_taken, const volatile unsigned char& stop, Run& run) {
  const long max_steps = run.max_steps;
  while (run.interval.t != run.interval.t1 && !stop) {
    const long attempts = run.taken + run.rejected;
    run.max_steps = std::min(max_steps, attempts + max_taken - run.taken);
    TimeLoop(method, s, run).advance();
    run.continued = true;
    if (run.needs_python || run.monitor.suspicious || run.taken + run.rejected == attempts) return false;
  }
  return true;
}

// Whether the run ends away from singular configurations, and all other rows are still dependent on those in use.
bool ends_away_from_singularity(Index2System& s, const Run& run) {
  const double* y = run.state.y.data();
  const Tolerances& tolerances = s.tree.tolerances;
  const SingularityMonitor& monitor = run.monitor;
  const int rank = s.rows.rank;
  if (run.monitored && rank && monitor.last_ratio < monitor.suspicious_ratio * monitor.largest_ratio &&
      s.pivot_ratio(y, rank) < tolerances.visible * monitor.largest_ratio)
    return false;
  return !run.project || !rank || rank == s.ng || s.remaining_rows_dependent(y, tolerances.search_tolerance);
}

Energy energy_at(Index2System& s, const double* y) {
  s.tree.inertia(y), s.point.invalidate();
  return energy(s, y);
}

void append_results(Index2System& s, const Run& run, const Vector& first, const Counts& n, int nodes, CoreRuns& out) {
  const Steps& steps = run.steps;
  const size_t last = steps.t.size(), length = s.length, last_node = nodes - 1;
  Energy e{NAN, NAN};
  for (const long x : {run.taken, run.rejected, n.f, n.M, n.G, n.solves, n.factorizations, n.projections,
                       n.state_projections, n.newton})
    out.records.push_back(static_cast<double>(x));
  out.records.insert(out.records.end(), {s.largest_g, s.largest_rate, s.largest_speed});
  for (size_t i = 0; i <= last_node; ++i) {
    const size_t k = last < last_node ? std::min(i, last) : i * last / last_node;
    const double* y = k ? &steps.y[(k - 1) * length] : first.data();
    out.y.insert(out.y.end(), y, y + length);
    if (i <= last) e = energy_at(s, y);
    out.energies.insert(out.energies.end(), {e.kinetic, e.potential});
  }
  out.z.resize(out.z.size() + s.nz, NAN);
  std::copy(steps.z.end() - (last ? s.nz : 0), steps.z.end(), out.z.end() - (last ? s.nz : 0));
  out.rows.push_back(s.rows.in_use());
}

}  // namespace

StartDerivative begin_run(Index2System& s, const RunStart& settings, const FirstStep* estimate, Run& run) {
  const double accuracy = s.accuracy, t = run.interval.t;
  Vector& y = run.state.y;
  StartDerivative out{Vector(s.ny), Vector(s.ng)};
  s.reset(), s.accuracy = accuracy;
  start(s, t, run.project, {settings.ambiguous, settings.fallen, settings.dependent}, y, out.F, out.z);
  if (estimate) run.control.h = std::max(first_step(s, t, y, out.F, *estimate), settings.shortest);
  run.state.carry = s.carry(out.F);
  return out;
}

void solve_runs(Method& method, Index2System& s, const RunStart& start, const FirstStep* first_step, const Run& options,
                const Vector& y, InPlaceParameters& parameters, const Vector& values, int nodes,
                const volatile unsigned char& stop, CoreRuns& out) {
  const size_t length = s.length;
  const double* run_values = values.data();
  for (auto y0 = y.begin(); y0 != y.end(); y0 += length, run_values += parameters.count()) {
    Run run = options;
    run.state.y.assign(y0, y0 + length);
    Vector first = run.state.y;
    Counts counts;
    bool finished = false;
    try {
      if (!parameters.write(run_values)) throw FallBackToPython();
      begin_run(s, start, first_step, run);
      first = run.state.y;
      finished = take_all_steps(method, s, start.longest, stop, run);
      counts = s.counts;
      if (stop) return;
      finished = finished && ends_away_from_singularity(s, run);
    } catch (const FallBackToPython&) {
    }
    out.finished.push_back(finished);
    append_results(s, run, first, counts, nodes, out);
  }
}

}  // namespace mbdae
