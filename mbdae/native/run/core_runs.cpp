#include "run/core_runs.hpp"

#include <algorithm>
#include <cmath>

#include "system/residuals.hpp"

namespace mbdae {

namespace {

// Steps to the end; false where Python must take one.
bool take_all_steps(Method& method, Index2System& s, long longest, const volatile unsigned char& stop, Run& run) {
  const long most = run.max_steps;
  while (run.interval.t != run.interval.t1 && !stop) {
    const long tried = run.taken + run.rejected;
    run.max_steps = std::min(most, tried + longest - run.taken);
    TimeLoop(method, s, run).advance();
    run.continued = true;
    if (run.needs_python || run.monitor.suspicious || run.taken + run.rejected == tried) return false;
  }
  return true;
}

// Does the run end away from singular configurations, and do the other rows still depend on those in use?
bool ends_regularly(Index2System& s, const Run& run) {
  const double* y = run.state.y.data();
  const Tolerances& limits = s.tree.limits;
  const SingularityMonitor& monitor = run.monitor;
  const int rank = s.rows.rank;
  if (run.monitored && rank && monitor.last_ratio < monitor.suspicious_ratio * monitor.largest_ratio &&
      s.pivot_ratio(y, rank) < limits.visible * monitor.largest_ratio)
    return false;
  return !run.project || !rank || rank == s.ng || s.remaining_rows_dependent(y, limits.search_tolerance);
}

Energy energy_at(Index2System& s, const double* y) {
  s.tree.inertia(y), s.point.invalidate();
  return energy(s, y);
}

void store(Index2System& s, const Run& run, const Vector& first, const Counts& n, int nodes, CoreRuns& out) {
  const Steps& steps = run.steps;
  const size_t last = steps.t.size(), length = s.length, most = nodes - 1;
  Energy e{NAN, NAN};
  for (const long x : {run.taken, run.rejected, n.f, n.M, n.G, n.solves, n.factorizations, n.projections,
                       n.state_projections, n.newton})
    out.records.push_back(static_cast<double>(x));
  out.records.insert(out.records.end(), {s.largest_g, s.largest_rate, s.largest_speed});
  for (size_t i = 0; i <= most; ++i) {
    const size_t k = last < most ? std::min(i, last) : i * last / most;
    const double* at = k ? &steps.y[(k - 1) * length] : first.data();
    out.y.insert(out.y.end(), at, at + length);
    if (i <= last) e = energy_at(s, at);
    out.energies.insert(out.energies.end(), {e.kinetic, e.potential});
  }
  out.z.resize(out.z.size() + s.nz, NAN);
  std::copy(steps.z.end() - (last ? s.nz : 0), steps.z.end(), out.z.end() - (last ? s.nz : 0));
  out.rows.push_back(s.rows.in_use());
}

}  // namespace

StartDerivative begin_run(Index2System& s, const RunStart& given, const FirstStep* estimate, Run& run) {
  const double accuracy = s.accuracy, t = run.interval.t;
  Vector& y = run.state.y;
  StartDerivative at{Vector(s.ny), Vector(s.ng)};
  s.reset(), s.accuracy = accuracy;
  start(s, t, run.project, {given.ambiguous, given.fallen, given.dependent}, y, at.F, at.z);
  if (estimate) run.control.h = std::max(first_step(s, t, y, at.F, *estimate), given.shortest);
  run.state.carry = s.carry(at.F);
  return at;
}

void solve_runs(Method& method, Index2System& s, const RunStart& start, const FirstStep* first_step, const Run& given,
                const Vector& y, InPlaceParameters& parameters, const Vector& values, int nodes,
                const volatile unsigned char& stop, CoreRuns& out) {
  const size_t length = s.length;
  const double* numbers = values.data();
  for (auto at = y.begin(); at != y.end(); at += length, numbers += parameters.count()) {
    Run run = given;
    run.state.y.assign(at, at + length);
    Vector first = run.state.y;
    Counts counts;
    bool finished = false;
    try {
      if (!parameters.write(numbers)) throw FallBackToPython();
      begin_run(s, start, first_step, run);
      first = run.state.y;
      finished = take_all_steps(method, s, start.longest, stop, run);
      counts = s.counts;
      if (stop) return;
      finished = finished && ends_regularly(s, run);
    } catch (const FallBackToPython&) {
    }
    out.finished.push_back(finished);
    store(s, run, first, counts, nodes, out);
  }
}

}  // namespace mbdae
