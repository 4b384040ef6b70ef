#include "run/time_loop.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

TimeLoop::TimeLoop(Method& method, Index2System& system, Run& run)
    : method_(method),
      s_(system),
      run_(run),
      size0_(s_.ny),
      size1_(s_.ny),
      z_(s_.nz),
      aside_(s_.mechanics, s_.constraints, s_.counts) {}

double TimeLoop::error_norm(const double* e, int errors, double noise) const {
  return run_.control.error_norm(e, errors, s_.ny, s_.measured(), size0_.data(), size1_.data(), s_.nv, 2 * s_.nv,
                                 noise);
}

bool TimeLoop::landing() {
  if (!run_.grid.behind(run_.leg)) return false;
  const SingularityMonitor& w = run_.watch;
  const double nearest = std::min(std::sqrt(s_.rows.least_pivot_ratio), w.before);
  const double limit = w.landed * std::min(w.usual, w.before);
  if (nearest < limit) return true;
  return nearest < w.suspect * w.usual && s_.ratio(next_.y.data(), std::max(s_.rows.rank, 1)) < limit;
}

bool TimeLoop::judge(double h) {
  if (!run_.adaptive) {
    if (!finite(next_.y.data(), s_.length)) throw FallBackToPython();
    if (run_.watched && landing()) throw FallBackToPython();
    return true;
  }
  StepControl& control = run_.control;
  const double noise = s_.ng ? method_.noise * largest(next_.y.data() + s_.nq, s_.nv) : 0;
  const double error = error_norm(errors_.data(), method_.errors, noise);
  control.h = control.next_step(h, error);
  if (error <= 1) {
    control.h = std::max(control.h, control.cut);
    return true;
  }
  if (!std::isfinite(error)) s_.point.forget();
  return false;
}

bool TimeLoop::shorten(double h) {
  run_.control.h = run_.control.next_step(h, INFINITY);
  if (!run_.control.large_enough(run_.leg, run_.control.h)) return false;
  s_.point.forget();
  ++run_.rejected;
  return true;
}

double TimeLoop::measure(const Numbers& move) const {
  if (run_.adaptive) return error_norm(move.data(), 1, 0);
  Numbers magnitude(size1_);
  add_magnitude(s_, next_.y.data(), magnitude.data());
  return largest_move(move, magnitude, s_.measured(), run_.tolerated, run_.nothing);
}

bool TimeLoop::taken_back(double h, const Numbers& y, const Numbers& move) const {
  Numbers step(s_.ny), undone(s_.ny, 0.0), slowed(s_.ny, 0.0);
  std::copy_n(move.begin(), s_.nv, undone.begin());
  for (int i = 0; i < s_.nv; ++i) slowed[i] = h * move[s_.nv + i];
  const double back = std::max(measure(undone), measure(slowed));
  if (!(back > 1)) return false;
  s_.difference(run_.state.y.data(), y.data(), step.data());
  std::fill(step.begin() + s_.nv, step.end(), 0.0);
  return back > run_.taken_back * measure(step);
}

void TimeLoop::project(double t) {
  const Numbers y = next_.y;
  renewed_ = false;
  restore(s_, t, next_.y.data());
  next_.low.clear();
  s_.size(next_.y.data(), size1_.data());  // of the next step's start, which must not hang on where a slice of time ends
  Numbers move(s_.ny);
  s_.difference(y.data(), next_.y.data(), move.data());
  const double moved = measure(move);
  if (taken_back(t - run_.leg.t, y, move)) throw FallBackToPython();
  if (!method_.carries || moved <= 1) return;
  Numbers F(s_.ny), z(s_.ng);  // what the method carries is computed again
  s_.derivative(t, next_.y.data(), F.data(), z.data());
  next_.carry = s_.carry(F), next_.memory.reset(), renewed_ = true;
}

void TimeLoop::look(Proposal& p) {
  const double t = run_.leg.t, h = p.t_next - t, least = s_.rows.least_pivot_ratio;
  const IndependentRows::Aside aside(s_.rows);
  // the input of `update_independent_rows` at the end, to the last bit
  const bool kept = s_.point.near(next_.y.data()) && !s_.point.exactly(next_.y.data());
  PointValues values(s_, kept ? &aside_ : nullptr);
  State end;  // swapped with `next_` while shorter steps are taken: arrays keep their addresses
  Numbers z, size;
  const bool renewed = renewed_;
  bool away = false;
  double last = 1;  // fraction of the step that was taken last
  auto shorter = [&](double theta) {
    values.part();
    if (!away) end = std::move(next_), next_ = State(), z = z_, size = size1_, away = true;
    method_.take(run_.adaptive, t, theta * h, run_.state, next_, z_.data(), errors_);
    if (run_.adaptive || run_.project) s_.size(next_.y.data(), size1_.data());
    if (run_.project) project(t + theta * h);
    last = theta;
    return next_.y;
  };
  const auto carried = [&](const State& x) {  // (v', s', w')
    return x.carry.empty() ? nullptr : x.carry.data() + (s_.carried() - (s_.ny - s_.nv));
  };
  const AcceptedStep taken{t, p.t_next, run_.state.y.data(), next_.y.data(), carried(run_.state), carried(next_)};
  seen_ = mbdae::look(s_, values, run_.events, taken, shorter);
  if (seen_.stop >= 0) {
    const bool near = run_.watched && std::sqrt(least) < run_.watch.zone * run_.watch.usual;
    if (near || seen_.stop * h == 0) throw FallBackToPython();
    if (last != seen_.stop) shorter(seen_.stop);
    p.t_next = t + seen_.stop * h;
  } else if (away) {
    next_ = std::move(end), z_ = z, size1_ = size, renewed_ = renewed;
  }
}

void TimeLoop::push() {
  Steps& steps = run_.steps;
  if (static_cast<long>(steps.t.size()) < run_.kept) {
    steps.carry.insert(steps.carry.end(), run_.state.carry.begin(), run_.state.carry.end());
    if (renewed_) steps.renewed.push_back(static_cast<long>(steps.t.size()));
  }
  renewed_ = false;
  steps.t.push_back(run_.leg.t);
  steps.y.insert(steps.y.end(), run_.state.y.begin(), run_.state.y.end());
  steps.z.insert(steps.z.end(), z_.begin(), z_.end());
  steps.least_pivot_ratio.push_back(s_.rows.least_pivot_ratio);
}

bool TimeLoop::cross() {
  const double t = run_.jumps.restart;
  Jumps jumps = run_.jumps;
  SmoothInterval leg = run_.leg;
  State& next = next_;
  next = State(), next.y = run_.state.y;
  Numbers F(s_.ny), z(s_.nz);
  const long node = static_cast<long>(run_.steps.t.size());
  try {
    if (!jumps.leg(s_.samplers, t, leg)) return false;
    s_.jump(t, next.y.data());
    if (s_.update_independent_rows(t, next)) run_.steps.changes.emplace_back(node, s_.rows.in_use());
    s_.derivative(t, next.y.data(), F.data(), z.data());
  } catch (const FallBackToPython&) {
    if (!run_.steps.changes.empty() && run_.steps.changes.back().first == node) run_.steps.changes.pop_back();
    s_.point.forget();
    return false;
  }
  next.carry = s_.carry(F);
  std::swap(run_.state, next), run_.leg = leg, run_.jumps.restart = jumps.restart;
  z_ = z;
  push();
  run_.steps.behind.push_back(node);
  run_.watch.before = INFINITY;
  if (run_.adaptive || run_.project) s_.size(run_.state.y.data(), size0_.data());
  return true;
}

bool TimeLoop::attempt() {
  Proposal p;
  if (!run_.adaptive)
    p = run_.grid.propose(run_.leg);
  else if (!run_.control.propose(run_.leg, p))
    return false;
  const double h = run_.leg.sign * p.h;
  if (run_.watched) s_.rows.least_pivot_ratio = 1;
  try {
    try {
      method_.take(run_.adaptive, run_.leg.t, h, run_.state, next_, z_.data(), errors_);
    } catch (const StepTooLong&) {
      return run_.adaptive && shorten(p.h);
    }
    if (run_.adaptive || run_.project) s_.size(next_.y.data(), size1_.data());
    if (!judge(p.h)) {
      ++run_.rejected;
      return true;
    }
    if (run_.project) project(p.t_next);
    if (!run_.events.events.empty()) look(p);
    if (s_.update_independent_rows(p.t_next, next_))
      run_.steps.changes.emplace_back(static_cast<long>(run_.steps.t.size()), s_.rows.in_use());
  } catch (const FallBackToPython&) {
    return false;
  }
  run_.leg.t = p.t_next;
  std::swap(run_.state, next_);
  std::swap(size0_, size1_);
  ++run_.taken;
  push();
  Events& events = run_.events;
  if (events.events.empty()) return true;
  events.nodes = std::move(seen_.nodes), events.stopped = seen_.stop >= 0;
  events.found.insert(events.found.end(), seen_.found.begin(), seen_.found.end());
  return true;
}

void TimeLoop::advance() {
  using Clock = std::chrono::steady_clock;
  const auto started = Clock::now();
  SingularityMonitor& watch = run_.watch;
  if (run_.adaptive || run_.project) s_.size(run_.state.y.data(), size0_.data());
  while (run_.taken + run_.rejected < run_.budget) {
    if (run_.leg.t == run_.leg.end && (!run_.jumps.crossed || std::isnan(run_.jumps.restart) || !cross())) return;
    const StepMemory control = run_.control;  // must be unchanged after an abandoned step
    const GridMemory grid = run_.grid;
    const Counts counts = s_.counts;
    const long taken = run_.taken;
    if (!attempt()) {
      static_cast<StepMemory&>(run_.control) = control;
      static_cast<GridMemory&>(run_.grid) = grid;
      s_.counts = counts, s_.point.forget(), run_.stuck = true;
      return;
    }
    if (run_.taken == taken) continue;
    if (run_.events.stopped) return;
    if (run_.watched) {
      const double before = watch.before, here = std::sqrt(s_.rows.least_pivot_ratio);
      watch.before = here, watch.usual = std::max(watch.usual, here);
      const bool falls = watch.entered || watch.ahead * (before - here) > here;
      if (run_.adaptive && here < watch.zone * watch.usual && falls) return;
    }
    if (!(std::chrono::duration<double>(Clock::now() - started).count() <= run_.seconds)) return;
  }
}

}  // namespace mbdae
