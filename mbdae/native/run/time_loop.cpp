// The loop over steps: attempt, acceptance, projection, singularity monitor, record.
#include "run/time_loop.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

double SingularityMonitor::expected_ratio(const Mode& mode, const SmallestPivot& previous,
                                          const SmallestPivot& current) const {
  const auto recorded = ratio_by_mode.find(mode);
  if (recorded != ratio_by_mode.end()) return recorded->second;
  const double smaller = std::min(previous.size, current.size), larger = std::max(previous.size, current.size);
  const double pivot_fraction = smaller < larger ? std::pow(smaller / larger, 2) : 1;
  const double regularity = previous.ratio < mode_ratio ? std::pow(previous.ratio / mode_ratio, 2) : 1;
  const double scale = std::sqrt(1 - pivot_fraction * (1 - regularity));
  return current.ratio < scale ? current.ratio / scale : 1;
}

void SingularityMonitor::enter(const Mode& previous, double largest) {
  ratio_by_mode[previous] = mode_ratio, mode_ratio = largest;
  if (by_mode) largest_ratio = largest;
}

TimeLoop::TimeLoop(Method& method, Index2System& system, Run& run)
    : method_(method),
      s_(system),
      run_(run),
      guards_(system, run.modes),
      size0_(s_.ny),
      size1_(s_.ny),
      z_(s_.nz),
      other_configuration_(s_.tree, s_.constraints, s_.counts) {}

double TimeLoop::error_norm(const double* e, int errors, double noise) const {
  return run_.control.error_norm(e, errors, s_.ny, s_.controlled_components(), size0_.data(), size1_.data(), s_.nv,
                                 2 * s_.nv, noise);
}

bool TimeLoop::ends_singular() {
  if (!run_.grid.more_before_end(run_.interval)) return false;
  const SingularityMonitor& monitor = run_.monitor;
  const double nearest = std::min(std::sqrt(s_.rows.least_pivot_ratio), monitor.last_ratio);
  const double limit = monitor.singular_ratio * std::min(monitor.largest_ratio, monitor.last_ratio);
  if (nearest < limit) return true;
  return nearest < monitor.suspicious_ratio * monitor.largest_ratio &&
         s_.pivot_ratio(next_.y.data(), std::max(s_.rows.rank, 1)) < limit;
}

bool TimeLoop::accept(double h) {
  if (!run_.adaptive) {
    if (!finite(next_.y.data(), s_.length)) throw FallBackToPython();
    if (run_.monitored && ends_singular()) throw FallBackToPython();
    return true;
  }
  StepControl& control = run_.control;
  const double noise = s_.ng ? method_.noise * largest(next_.y.data() + s_.nq, s_.nv) : 0;
  const double error = error_norm(errors_.data(), method_.errors, noise);
  control.h = control.next_step(h, error);
  if (error <= 1) {
    control.h = std::max(control.h, control.uncut_size);
    return true;
  }
  if (!std::isfinite(error)) s_.point.invalidate();
  return false;
}

bool TimeLoop::shorten(double h) {
  run_.control.h = run_.control.next_step(h, INFINITY);
  if (!run_.control.large_enough(run_.interval, run_.control.h)) return false;
  s_.point.invalidate();
  ++run_.rejected;
  return true;
}

double TimeLoop::move_norm(const Vector& x) const {
  if (run_.adaptive) return error_norm(x.data(), 1, 0);
  Vector magnitude(size1_);
  add_characteristic_magnitudes(s_, next_.y.data(), magnitude.data());
  return largest_move(x, magnitude, s_.controlled_components(), run_.tolerated_move, run_.tiny);
}

bool TimeLoop::undoes_step(double h, double projection_norm) {
  partial_displacement_.assign(s_.ny, 0.0);
  for (int i = 0; i < s_.nv; ++i) partial_displacement_[i] = h * displacement_[s_.nv + i];
  double undone = move_norm(partial_displacement_);
  if (projection_norm > 1) {  // only then may the displacement of the coordinates alone exceed 1
    std::copy_n(displacement_.begin(), s_.nv, partial_displacement_.begin());
    undone = std::max(undone, move_norm(partial_displacement_));
  }
  if (!(undone > 1)) return false;
  s_.difference(run_.state.y.data(), unprojected_.data(), partial_displacement_.data());
  std::fill(partial_displacement_.begin() + s_.nv, partial_displacement_.end(), 0.0);
  return undone > run_.max_undone * move_norm(partial_displacement_);
}

void TimeLoop::project(double t) {
  unprojected_ = next_.y, displacement_.resize(s_.ny);
  restarted_ = false;
  project_state(s_, t, next_.y.data());
  next_.low.clear();
  s_.component_magnitudes(next_.y.data(), size1_.data());  // needed if `advance` is interrupted
  s_.difference(unprojected_.data(), next_.y.data(), displacement_.data());
  const double projection_norm = move_norm(displacement_);
  if (undoes_step(t - run_.interval.t, projection_norm)) throw FallBackToPython();
  if (!method_.carries || projection_norm <= 1) return;
  Vector F(s_.ny), z(s_.ng);  // the carry restarts
  s_.derivative(t, next_.y.data(), F.data(), z.data());
  next_.carry = s_.carry(F), next_.memory.reset(), restarted_ = true;
}

void TimeLoop::record() {
  Steps& steps = run_.steps;
  if (static_cast<long>(steps.t.size()) < run_.max_carries) {
    steps.carry.insert(steps.carry.end(), run_.state.carry.begin(), run_.state.carry.end());
    if (restarted_) steps.restarted.push_back(static_cast<long>(steps.t.size()));
  }
  restarted_ = false;
  steps.t.push_back(run_.interval.t);
  steps.y.insert(steps.y.end(), run_.state.y.begin(), run_.state.y.end());
  steps.z.insert(steps.z.end(), z_.begin(), z_.end());
  steps.least_pivot_ratio.push_back(s_.rows.least_pivot_ratio);
}

bool TimeLoop::attempt() {
  Proposal p;
  if (!run_.adaptive)
    p = run_.grid.propose(run_.interval);
  else if (!run_.control.propose(run_.interval, p))
    return false;
  const double h = run_.interval.sign * p.h;
  if (run_.monitored) s_.rows.least_pivot_ratio = 1;
  try {
    try {
      method_.take(run_.adaptive, run_.interval.t, h, run_.state, next_, z_.data(), errors_);
    } catch (const StepTooLong&) {
      return run_.adaptive && shorten(p.h);
    }
    if (run_.adaptive || run_.project) s_.component_magnitudes(next_.y.data(), size1_.data());
    if (!accept(p.h)) {
      ++run_.rejected;
      return true;
    }
    if (run_.project) project(p.t_next);
    if (guards_.checks_steps()) {
      if (!complete_step(p)) return true;
    } else {
      if (!run_.events.events.empty()) detect_events(p);
      if (s_.update_independent_rows(p.t_next, next_))
        run_.steps.changes.emplace_back(static_cast<long>(run_.steps.t.size()), s_.rows.in_use());
    }
  } catch (const FallBackToPython&) {
    return false;
  }
  run_.interval.t = p.t_next;
  std::swap(run_.state, next_);
  std::swap(size0_, size1_);
  ++run_.taken;
  record();
  Events& events = run_.events;
  if (events.events.empty()) return true;
  events.nodes = std::move(detected_.nodes), events.stopped = detected_.stop >= 0;
  events.located.insert(events.located.end(), detected_.located.begin(), detected_.located.end());
  return true;
}

void TimeLoop::advance() {
  using Clock = std::chrono::steady_clock;
  const auto started = Clock::now();
  SingularityMonitor& monitor = run_.monitor;
  if (run_.adaptive || run_.project) s_.component_magnitudes(run_.state.y.data(), size0_.data());
  while (run_.taken + run_.rejected < run_.max_steps) {
    if (run_.interval.t == run_.interval.end &&
        (!run_.jumps.in_core || std::isnan(run_.jumps.restart) || !apply_jump()))
      return;
    const StepMemory control = run_.control;  // restored after a failed attempt
    const GridMemory grid = run_.grid;
    const Counts counts = s_.counts;
    const long taken = run_.taken;
    if (!attempt()) {
      static_cast<StepMemory&>(run_.control) = control;
      static_cast<GridMemory&>(run_.grid) = grid;
      s_.counts = counts, s_.point.invalidate(), run_.needs_python = true;
      return;
    }
    if (run_.taken == taken) {
      apply_transition();  // at the start of the step
      continue;
    }
    immediate_ = 0;
    if (run_.events.stopped) return;
    bool stop = false;
    if (run_.monitored) {
      const double previous = monitor.last_ratio, ratio = std::sqrt(s_.rows.least_pivot_ratio);
      monitor.update(ratio);
      const double low = std::min(previous, ratio), high = std::isinf(previous) ? ratio : std::max(previous, ratio);
      const bool falls =
          monitor.near_singular || (std::isfinite(previous) && monitor.steps_ahead * (previous - ratio) > ratio);
      monitor.suspicious |=
          (ratio < monitor.monitored_ratio * monitor.largest_ratio && falls) ||
          low < monitor.small_ratio * monitor.largest_ratio ||
          (low < monitor.suspicious_ratio * monitor.largest_ratio && low < monitor.notch_ratio * high);
      stop = run_.adaptive && ratio < monitor.monitored_ratio * monitor.largest_ratio && falls;
    }
    apply_transition();
    if (stop) return;
    if (!(std::chrono::duration<double>(Clock::now() - started).count() <= run_.seconds)) return;
  }
}

}  // namespace mbdae
