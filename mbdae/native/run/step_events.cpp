// Events of steps in the time loop: signals, mode transitions, impacts, jumps.
#include <algorithm>
#include <cmath>

#include "run/mode_transition.hpp"
#include "run/partial_steps.hpp"

namespace mbdae {

void TimeLoop::detect_events(Proposal& p) {
  const double t = run_.interval.t, h = p.t_next - t, smallest_pivot_ratio = s_.rows.least_pivot_ratio;
  const IndependentRows::Freeze freeze(s_.rows);
  // to the last bit, the configuration with which `update_independent_rows` is called at the end
  const bool save_configuration = s_.point.is_current(next_.y.data()) && !s_.point.is_exactly_current(next_.y.data());
  PointValues values(s_, save_configuration ? &other_configuration_ : nullptr);
  PartialSteps steps(*this, h);
  auto partial_step = [&](double theta) {
    values.exchange();
    return steps.take(theta);
  };
  const auto carried_rates = [&](const State& x) {  // (v', s', w')
    return x.carry.empty() ? nullptr : x.carry.data() + (s_.carry_length() - (s_.ny - s_.nv));
  };
  const AcceptedStep taken{
      t, p.t_next, run_.state.y.data(), next_.y.data(), carried_rates(run_.state), carried_rates(next_)};
  detected_ = mbdae::detect_events(s_, values, run_.events, taken, partial_step);
  if (detected_.stop >= 0) {
    const bool monitored =
        run_.monitored && std::sqrt(smallest_pivot_ratio) < run_.monitor.monitored_ratio * run_.monitor.largest_ratio;
    if (monitored || detected_.stop * h == 0) throw FallBackToPython();
    values.exchange();
    steps.end_at(detected_.stop, p);
  } else {
    steps.discard();
  }
}

bool TimeLoop::detect_transition(Proposal& p, std::vector<int>& fired) {
  const double t = run_.interval.t, h = p.t_next - t, smallest_pivot_ratio = s_.rows.least_pivot_ratio;
  const Modes& modes = run_.modes;
  const IndependentRows::Freeze freeze(s_.rows);
  PartialSteps steps(*this, h);
  const AcceptedStep taken{t, p.t_next, run_.state.y.data(), next_.y.data(), nullptr, nullptr};
  double theta = 1;
  const PartialStep partial_step = [&](double x) { return steps.take(x); };
  const double error = guards_.begin_step(taken, partial_step, !run_.adaptive);
  if (error > 0 && run_.adaptive) {
    const double factor = std::max(modes.shrink, modes.safety * std::pow(error, -1.0 / 4));
    run_.control.h = std::min(run_.control.h, std::max(modes.shortest, h * factor)), run_.control.uncut_size = 0;
    if (error > 1 && h > 2 * modes.shortest) return false;
  }
  fired = guards_.first_roots(theta);
  if (fired.empty()) {
    guards_.advance(), steps.discard();
    return true;
  }
  const double end = t + theta * h, ratio = std::sqrt(smallest_pivot_ratio);
  const SingularityMonitor& monitor = run_.monitor;
  const double previous = (1 - s_.tree.tolerances.search_tolerance) * monitor.last_ratio;
  const bool low = ratio < previous && ratio < monitor.suspicious_ratio * monitor.largest_ratio;
  const bool suspicious = run_.monitored && low &&
                          (ratio < monitor.small_ratio * monitor.largest_ratio ||
                           (std::isfinite(previous) && ratio < monitor.notch_ratio * previous));
  if (suspicious || !(end <= p.t_next && end < run_.interval.stop)) throw FallBackToPython();
  if (end == t) {
    if (++immediate_ > modes.max_impacts) throw FallBackToPython();
    next_ = run_.state, p.t_next = t, run_.grid.undo_step();
    return true;
  }
  theta < 1 ? steps.end_at(theta, p) : steps.discard();
  return true;
}

bool TimeLoop::complete_step(Proposal& p) {
  const std::vector<int> previous_rows = s_.rows.in_use();
  const long node = static_cast<long>(run_.steps.t.size());
  run_.modes.undecided = true;  // until all of this has succeeded
  std::vector<int> fired;
  bool resolved;
  try {
    resolved = detect_transition(p, fired);
    const bool taken = p.t_next != run_.interval.t;
    if (resolved && taken && s_.update_independent_rows(p.t_next, next_))
      run_.steps.changes.emplace_back(node, s_.rows.in_use());
    if (!fired.empty()) resolve_transition(fired, p.t_next, !taken);
    resolved = resolved && taken;
  } catch (const FallBackToPython&) {
    std::vector<std::pair<long, std::vector<int>>>& changes = run_.steps.changes;
    if (!changes.empty() && changes.back().first == node) changes.pop_back();
    if (s_.rows.in_use() != previous_rows) s_.use_rows(previous_rows, s_.rows.rank, s_.rows.floor, s_.rows.frozen);
    throw;
  }
  run_.modes.undecided = false;
  if (!resolved) ++run_.rejected;
  return resolved;
}

// At the start of an interval, see `SingularityMonitor._time_to_singularity` in Python.
bool TimeLoop::is_near_singular(const NextMode& next, double largest) {
  const SingularityMonitor& monitor = run_.monitor;
  const double* y = next.state.y.data();
  if (!run_.monitored || !s_.rows.rank) return false;
  const double ratio = s_.pivot_ratio(y, s_.rows.rank);
  if (!run_.adaptive) return ratio < monitor.adjacent_ratio * largest;
  if (!(ratio < monitor.monitored_ratio * largest)) return false;
  double earlier_ratio = INFINITY;
  Vector earlier(s_.length);
  for (double h = run_.control.h; std::fabs(earlier_ratio - ratio) > monitor.max_change * ratio;) {
    Vector displacement(next.F);
    h /= 2;
    for (double& x : displacement) x *= -h;
    s_.add(y, displacement.data(), earlier.data());
    earlier_ratio = s_.pivot_ratio(earlier.data(), s_.rows.rank);
  }
  return ratio < earlier_ratio;
}

void TimeLoop::resolve_transition(const std::vector<int>& fired, double t, bool immediate) {
  const SingularityMonitor& monitor = run_.monitor;
  previous_mode_ = run_.modes.mode, next_mode_ratio_ = monitor.mode_ratio;
  const SmallestPivot previous_pivot =
      run_.monitored ? s_.smallest_pivot(next_.y.data(), s_.rows.rank) : SmallestPivot();
  const auto check = [&](const NextMode& next) {
    if (!run_.monitored) return;
    if (next.transition.mode != previous_mode_) {
      if (monitor.suspicious || monitor.near_singular) throw FallBackToPython();
      const SmallestPivot pivot = s_.smallest_pivot(next.state.y.data(), s_.rows.rank);
      next_mode_ratio_ = monitor.expected_ratio(next.transition.mode, previous_pivot, pivot);
    }
    if (is_near_singular(next, monitor.by_mode ? next_mode_ratio_ : monitor.largest_ratio)) throw FallBackToPython();
  };
  next_mode_ = enter_next_mode(s_, run_.modes, guards_, run_.project, t, next_.y, fired, immediate, check);
  changes_mode_ = true;
}

void TimeLoop::begin_interval(const Vector& z) {
  z_ = z;
  run_.steps.after_jumps.push_back(static_cast<long>(run_.steps.t.size()));
  record();
  run_.monitor.last_ratio = INFINITY;
  if (run_.adaptive || run_.project) s_.component_magnitudes(run_.state.y.data(), size0_.data());
}

void TimeLoop::apply_transition() {
  if (!changes_mode_) return;
  changes_mode_ = false;
  next_mode_.transition.node = static_cast<long>(run_.steps.t.size());
  run_.steps.changes.emplace_back(next_mode_.transition.node, s_.rows.in_use());
  std::swap(run_.state, next_mode_.state);
  begin_interval(next_mode_.z);
  if (previous_mode_ != run_.modes.mode) run_.monitor.enter(previous_mode_, next_mode_ratio_);
  run_.modes.transitions.push_back(std::move(next_mode_.transition));
}

bool TimeLoop::apply_jump() {
  const double t = run_.jumps.restart;
  Jumps jumps = run_.jumps;
  SmoothInterval interval = run_.interval;
  State& next = next_;
  next = State(), next.y = run_.state.y;
  Vector F(s_.ny), z(s_.nz);
  const long node = static_cast<long>(run_.steps.t.size());
  try {
    if (!jumps.next_interval(s_.samplers, t, interval)) return false;
    s_.apply_jumps(t, next.y.data());
    if (s_.update_independent_rows(t, next)) run_.steps.changes.emplace_back(node, s_.rows.in_use());
    s_.derivative(t, next.y.data(), F.data(), z.data());
  } catch (const FallBackToPython&) {
    if (!run_.steps.changes.empty() && run_.steps.changes.back().first == node) run_.steps.changes.pop_back();
    s_.point.invalidate();
    return false;
  }
  next.carry = s_.carry(F);
  std::swap(run_.state, next), run_.interval = interval, run_.jumps.restart = jumps.restart;
  begin_interval(z);
  return true;
}

}  // namespace mbdae
