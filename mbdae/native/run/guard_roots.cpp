// Resolution of the multipliers of guards on a step, and the first roots of guards.
#include <algorithm>
#include <cmath>

#include "math/brent.hpp"
#include "math/interpolant.hpp"
#include "math/vec3.hpp"
#include "run/mode_guards.hpp"

namespace mbdae {

double GuardMonitor::begin_step(const AcceptedStep& step, const PartialStep& partial_step, bool refines) {
  step_ = &step, partial_step_ = &partial_step, intervals_ = 4, interpolated_.clear();
  points_.remove_if([&](const Point& p) { return p.t != step.t || !std::equal(p.y.begin(), p.y.end(), step.y); });
  for (Point& p : points_) p.theta = 0;  // the end of the last step, or the start of a rejected step
  const bool first = points_.empty();
  const Counts counts = s_.counts;
  if (!has_references_) prepare(), set_references(point(0));
  point(0);
  if (first) s_.counts = counts;  // counts must not depend on how a run is split into calls
  double worst = resolution_error();
  for (; refines && worst > 1 && intervals_ < modes_.finest; worst = resolution_error())
    intervals_ *= 2, interpolated_.clear();
  return worst;
}

double GuardMonitor::resolution_error() {
  double worst = 0;
  for (const Guard& guard : modes_.guards) worst = std::max(worst, resolution_error(guard));
  return worst;
}

Vector GuardMonitor::monitored_multipliers(const Guard& guard) {
  Vector out;
  for (int k = 0; k <= intervals_; ++k)
    out.push_back(monitored_multiplier(guard, point(static_cast<double>(k) / intervals_)));
  return out;
}

double GuardMonitor::longest_step(const Guard& guard, const Point& p) const {
  const Switch& x = of(guard);
  const double scale = s_.tree.tolerances.coordinate_scales[x.column];
  return x.shortest / std::max(std::fabs(p.y[s_.nq + x.column]), s_.tree.tolerances.zero_speed * speed(p) * scale);
}

// Whether the value of a guard depends on one multiplier: not if several joints stick.
bool GuardMonitor::depends_on_one_multiplier(const Guard& guard) const {
  if (guard.kind != Guard::slip || of(guard).frictional()) return guard.monitors_multiplier();
  int sticking = 0;
  for (size_t k = 0; k < modes_.switches.size(); ++k)
    sticking += modes_.switches[k].kind == Switch::Kind::stiction && modes_.mode[k] == active;
  return sticking == 1;
}

// Multipliers at the samples of a step: at its ends, and between them on the Hermite cubic through both ends.
Vector GuardMonitor::interpolated_multipliers(const Guard& guard) {
  const Point &start = point(0), &end = point(1);
  if (interpolated_.empty()) {
    const double h = step_->t1 - step_->t;
    Vector displacement(s_.ny), x(s_.ny);
    s_.difference(start.y.data(), end.y.data(), displacement.data());
    for (int k = 1; k < intervals_; ++k) {
      const double a = static_cast<double>(k) / intervals_, b = 1 - a;
      Point p{a, step_->t + a * h, Vector(s_.length)};
      for (int i = 0; i < s_.ny; ++i) {
        x[i] = a * a * (a + 3 * b) * displacement[i] + h * a * b * (b * start.F[i] - a * end.F[i]);
      }
      s_.add(start.y.data(), x.data(), p.y.data());
      p.F.resize(s_.ny), p.lam.resize(s_.ng);
      s_.derivative(p.t, p.y.data(), p.F.data(), p.lam.data());
      interpolated_.push_back(std::move(p));
    }
  }
  Vector out{monitored_multiplier(guard, start)};
  for (const Point& p : interpolated_) out.push_back(monitored_multiplier(guard, p));
  out.push_back(monitored_multiplier(guard, end));
  return out;
}

double GuardMonitor::resolution_error(const Guard& guard) {
  const double h = step_->t1 - step_->t;
  if (guard.kind == Guard::range_boundary)
    return std::pow(4 * h / intervals_ / std::min(longest_step(guard, point(0)), longest_step(guard, point(1))), 4);
  if (!guard.monitors_multiplier()) return 0;
  const bool is_slip = guard.kind == Guard::slip;
  const double weights[5] = {1, -4, 6, -4, 1};
  const Vector all = interpolated_multipliers(guard);
  double largest_multiplier = 0, smallest_multiplier = INFINITY, fourth_difference = 0, terms = 0;
  for (double x : all)
    largest_multiplier = std::max(largest_multiplier, std::fabs(x)),
    smallest_multiplier = std::min(smallest_multiplier, x);
  for (double x : weights) terms += std::fabs(x);
  for (int k = 0; k < intervals_; k += 4)
    fourth_difference = std::max(fourth_difference, std::fabs(dot(weights, &all[k], 5)));
  if (!is_slip && !(fourth_difference > terms * s_.tree.tolerances.solution_rounding * point(0).force)) return 0;
  const double size = is_slip ? 1 : std::max(largest_multiplier, s_.tree.tolerances.visible * guard.size);
  const double distance = is_slip ? 1 - largest_multiplier : smallest_multiplier / (size > 0 ? size : 1);
  return fourth_difference / (size * modes_.rough * std::max(distance >= 0 ? distance : 1.0, modes_.near_limit));
}

// Increasing fractions of the step at which a guard may be negative: the samples, and the extrema of quartics through
// multipliers, if they are close to the limit.
std::vector<double> GuardMonitor::samples(int i) {
  const Guard& guard = modes_.guards[i];
  const bool one_multiplier = depends_on_one_multiplier(guard);
  const Vector all = one_multiplier                ? interpolated_multipliers(guard)
                     : guard.monitors_multiplier() ? monitored_multipliers(guard)
                                                   : Vector();
  const double size = largest(all.data(), static_cast<int>(all.size()));
  const auto close = [&](double multiplier) {
    if (guard.kind == Guard::slip) return std::fabs(multiplier) > 1 - modes_.close_extremum;
    return multiplier < modes_.close_extremum * (size > 0 ? size : 1);
  };
  std::vector<double> out;
  for (int k = 1; k <= intervals_; ++k)
    if (!one_multiplier || close(all[k])) out.push_back(static_cast<double>(k) / intervals_);
  for (size_t k = 0; k + 4 < all.size(); k += 4) {
    const Interpolant quartic(&all[k], 5);
    for (double x : quartic.extrema(-4 * modes_.outside, 4 * (1 + modes_.outside)))
      if (close(quartic.value(x))) out.push_back(std::clamp((static_cast<double>(k) + x) / intervals_, 0.0, 1.0));
  }
  std::sort(out.begin(), out.end());
  return out;
}

double GuardMonitor::negative_fraction(int i) {
  const Guard& guard = modes_.guards[i];
  if (guard.needs_multipliers()) {
    for (double theta : samples(i))
      if (theta > 0 && at(theta, i).f < -rounding(i)) return theta;
    return 0;
  }
  const double h = step_->t1 - step_->t, return_fraction = (guard.return_time - step_->t) / h;
  const Value end = at(1, i);
  if (end.f < -rounding(i)) return 1;
  if (0 < return_fraction && return_fraction < 1 && at(return_fraction, i).f < -rounding(i)) return return_fraction;
  if (!has_rate(guard) || !(end.rate > 0)) return 0;
  const Value start = at(0, i);
  const Cubic cubic(start.f, end.f, h * start.rate, h * end.rate);
  if (!cubic.has_minimum() || cubic.minimum() > modes_.grazing * std::min(start.f, end.f)) return 0;
  const auto rate = [&](double theta) { return at(theta, i).rate; };
  const double small = modes_.coincident, falling_fraction = cubic.falling_point();
  const double falling_rate = rate(falling_fraction);
  if (!(falling_rate < 0)) return 0;
  const double theta = brent(rate, falling_fraction, falling_rate, 1, end.rate, small, small, modes_.root_iterations);
  return at(theta, i).f < -rounding(i) ? theta : 0;
}

double GuardMonitor::time_tolerance() const {
  const double scale = std::max(std::fabs(step_->t), std::fabs(step_->t1));
  return modes_.spacings * (std::nextafter(scale, INFINITY) - scale) / (step_->t1 - step_->t);
}

double GuardMonitor::locate(int i, double high) {
  if (!has_rate(modes_.guards[i])) return dynamic_ ? locate_by_quartic(i, high) : locate_by_brent(i, high);
  const double h = step_->t1 - step_->t, tolerance = time_tolerance();
  const Value start = at(0, i), end = at(high, i);
  const bool starts_at_zero = start.f <= rounding(i);
  const double low = starts_at_zero ? modes_.start_root * high : 0;
  double theta = high * Cubic(std::max(start.f, 0.0), end.f, high * h * start.rate, high * h * end.rate).first_zero();
  double best_theta = 0, best_value = INFINITY;
  Interpolant interpolant;  // converges faster than Newton's method at the same cost
  interpolant.add(0, start.f, h * start.rate), interpolant.add(high, end.f, h * end.rate);
  for (int k = 0; k < modes_.iterations && low < theta && theta < high; ++k) {
    const Value x = at(theta, i);
    if (!(x.rate < 0) || !(std::fabs(x.f) < best_value)) {
      if (best_value <= rounding(i)) return best_theta;
      break;
    }
    const double newton_step = x.f / (h * x.rate);
    if (std::fabs(newton_step) <= tolerance + modes_.step_tolerance * theta) return theta;
    interpolant.add(theta, x.f, h * x.rate);
    best_theta = theta, best_value = std::fabs(x.f), theta = interpolant.root(theta - newton_step);
  }
  return locate_by_brent(i, high);
}

// The root of the quartic through five values, corrected by the interpolant of its errors at the ends of partial steps.
double GuardMonitor::locate_by_quartic(int i, double high) {
  if (intervals_ > 4) return locate_by_brent(i, high);
  const double tolerance = time_tolerance();
  const Guard& guard = modes_.guards[i];
  const bool one_multiplier = depends_on_one_multiplier(guard);
  Vector values;
  if (one_multiplier) {
    values = interpolated_multipliers(guard);
    for (double& x : values) x = (guard.kind == Guard::slip ? 1 - std::fabs(x) : x) - guard.level;
  } else {
    for (int k = 0; k < 5; ++k) values.push_back(at(static_cast<double>(k) / 4, i).f);
  }
  const Interpolant quartic(values.data(), 5);
  Interpolant errors;
  for (int k = 0; k < 5; k += one_multiplier ? 4 : 1) errors.add(k, 0);  // ends of partial steps
  if (one_multiplier)
    for (const Point& p : points_)
      if (0 < p.theta && p.theta < 1) errors.add(4 * p.theta, at(p, i).f - quartic.value(4 * p.theta));
  const auto corrected = [&](double x) {
    const auto [f, df] = quartic.evaluate(x);
    const auto [error, rate] = errors.evaluate(x);
    return std::pair(f + error, df + rate);
  };
  if (!(at(0, i).f > rounding(i))) return locate_by_brent(i, high);
  double theta = newton_root(corrected, quartic.first_zero(4 * high)) / 4, best_value = INFINITY, best_theta = 0;
  for (int k = 0; k < modes_.iterations && 0 < theta && theta < high; ++k) {
    const double f = at(theta, i).f;
    if (!(corrected(4 * theta).second < 0) || !(std::fabs(f) < best_value)) {
      if (best_value <= rounding(i)) return best_theta;
      break;
    }
    errors.add(4 * theta, f - quartic.value(4 * theta));
    const double root = newton_root(corrected, 4 * theta) / 4;
    if (!(std::fabs(root - theta) > tolerance + modes_.step_tolerance * theta)) return theta;
    best_theta = theta, best_value = std::fabs(f), theta = root;
  }
  return locate_by_brent(i, high);
}

// A guard that is zero at the start is divided by theta, which gives its mean rate; returns 0 if the rate is negative.
double GuardMonitor::locate_by_brent(int i, double high) {
  const bool starts_at_zero = at(0, i).f <= rounding(i);
  const auto value = [&](double theta) { return at(theta, i).f / (starts_at_zero ? theta : 1); };
  double low = 0;
  if (starts_at_zero) {
    low = 0.5 * high;
    for (int k = 2; k < modes_.max_halvings && !(at(low, i).f > 0); ++k) low *= 0.5;
    if (!(at(low, i).f > 0)) return 0;
  }
  return brent(value, low, value(low), high, value(high), time_tolerance(), modes_.step_tolerance,
               modes_.root_iterations);
}

std::vector<int> GuardMonitor::first_roots(double& theta) {
  const int n = static_cast<int>(modes_.guards.size());
  std::vector<std::pair<int, double>> candidates;
  for (int i = 0; i < n; ++i)
    if (const double high = negative_fraction(i); high > 0) candidates.emplace_back(i, high);
  std::vector<int> first;
  while (!candidates.empty()) {  // guards that cross zero before theta
    const int i = candidates.front().first;
    const double root = locate(i, candidates.front().second);
    if (first.empty() || root < theta - 4 * time_tolerance())
      theta = root, first = {i};
    else
      first.push_back(i);
    candidates.clear();
    for (int k = 0; k < n; ++k)
      if (std::find(first.begin(), first.end(), k) == first.end() && at(theta, k).f < -rounding(k))
        candidates.emplace_back(k, theta);
  }
  return first;
}

}  // namespace mbdae
