#include "time_loop.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "vec3.hpp"

namespace mbdae {

TimeLoop::TimeLoop(Method& method, Index2System& system, Run& run)
    : method_(method), s_(system), run_(run), size0_(s_.ny), size1_(s_.ny), z_(s_.ng) {}

double TimeLoop::error_norm(const double* e, int errors, double noise) const {
  return run_.control.error_norm(e, errors, s_.ny, s_.measured(), size0_.data(), size1_.data(), s_.nv, 2 * s_.nv,
                                 noise);
}

bool TimeLoop::landing() {
  if (!run_.grid.behind(run_.leg)) return false;
  const SingularWatch& w = run_.watch;
  const double nearest = std::min(std::sqrt(s_.rows.least_pivot_ratio), w.before);
  const double limit = w.landed * std::min(w.usual, w.before);
  if (nearest < limit) return true;
  return nearest < w.suspect * w.usual && s_.ratio(next_.y.data(), std::max(s_.rows.rank, 1)) < limit;
}

bool TimeLoop::judge(double h) {
  if (!run_.adaptive) {
    if (!finite(next_.y.data(), s_.length)) throw Trouble();
    if (run_.watched && landing()) throw Trouble();
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

void TimeLoop::project(double t) {
  const Numbers y = next_.y;
  restore(s_, t, next_.y.data());
  next_.low.clear();
  if (!method_.carries) return;
  Numbers move(s_.ny);
  s_.difference(y.data(), next_.y.data(), move.data());
  s_.size(next_.y.data(), size1_.data());
  bool tolerated = true;
  if (run_.adaptive)
    tolerated = error_norm(move.data(), 1, 0) <= 1;
  else
    for (int k = 0; k < s_.measured(); ++k)
      tolerated = tolerated && std::fabs(move[k]) <= run_.tolerated * (1 + size1_[k]);
  if (tolerated) return;
  Numbers F(s_.ny), z(s_.ng);  // what the method carries is found anew
  s_.derivative(t, next_.y.data(), F.data(), z.data());
  next_.carry.assign(F.begin() + s_.nv, F.end()), next_.memory.reset();
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
    method_.take(run_.adaptive, run_.leg.t, h, run_.state, next_, z_.data(), errors_);
    if (run_.adaptive || run_.project) s_.size(next_.y.data(), size1_.data());
    if (!judge(p.h)) {
      ++run_.rejected;
      return true;
    }
    if (run_.project) project(p.t_next);
    if (s_.settle(p.t_next, next_)) run_.steps.changes.emplace_back(run_.taken + 1, s_.rows.in_use());
  } catch (const Trouble&) {
    return false;
  }
  run_.leg.t = p.t_next;
  std::swap(run_.state, next_);
  std::swap(size0_, size1_);
  ++run_.taken;
  Steps& steps = run_.steps;
  steps.t.push_back(run_.leg.t);
  steps.y.insert(steps.y.end(), run_.state.y.begin(), run_.state.y.end());
  steps.z.insert(steps.z.end(), z_.begin(), z_.end());
  steps.least_pivot_ratio.push_back(s_.rows.least_pivot_ratio);
  return true;
}

void TimeLoop::advance() {
  using Clock = std::chrono::steady_clock;
  const auto started = Clock::now();
  SingularWatch& watch = run_.watch;
  if (run_.adaptive || run_.project) s_.size(run_.state.y.data(), size0_.data());
  while (run_.taken + run_.rejected < run_.budget && run_.leg.t != run_.leg.end) {
    const StepMemory control = run_.control;  // what a step that is given up must not have changed
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
    if (run_.watched) {
      watch.before = std::sqrt(s_.rows.least_pivot_ratio);
      watch.usual = std::max(watch.usual, watch.before);
    }
    if (run_.watched && run_.adaptive && watch.before < watch.zone * watch.usual) return;  // Python looks ahead
    if (!(std::chrono::duration<double>(Clock::now() - started).count() <= run_.seconds)) return;
  }
}

}  // namespace mbdae
