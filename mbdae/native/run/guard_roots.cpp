#include <algorithm>
#include <cmath>

#include "math/brent.hpp"
#include "math/interpolant.hpp"
#include "math/vec3.hpp"
#include "run/mode_guards.hpp"

namespace mbdae {

namespace {

constexpr int NEWTON_STEPS = 3;  // from a point of the polynomial to its root, which is near

}  // namespace

double GuardMonitor::begin_step(const AcceptedStep& step, const PartialStep& shorter) {
  step_ = &step, shorter_ = &shorter;
  known_.remove_if([&](const Point& p) { return p.t != step.t || !std::equal(p.y.begin(), p.y.end(), step.y); });
  for (Point& p : known_) p.theta = 0;  // the end of the last step, or the start of one that was rejected
  interpolated_.clear();
  const bool first = known_.empty();
  const Counts counts = s_.counts;
  if (!referenced_) prepare();
  point(0);
  if (first) s_.counts = counts;  // they do not depend on the number of calls
  double worst = 0;
  for (const Guard& guard : modes_.guards) worst = std::max(worst, unresolved(guard));
  return worst;
}

double GuardMonitor::longest_step(const Guard& guard, const Point& p) const {
  const Switch& x = of(guard);
  const double scale = s_.mechanics.limits.coordinate_scales[x.column];
  return x.shortest / std::max(std::fabs(p.y[s_.nq + x.column]), s_.mechanics.limits.zero_speed * speed(p) * scale);
}

// Whether the value of a guard follows from its load alone, which several sticking joints may share.
bool GuardMonitor::has_own_load(const Guard& guard) const {
  if (guard.kind != Guard::slip || of(guard).frictional()) return guard.has_load();
  int sticking = 0;
  for (size_t k = 0; k < modes_.switches.size(); ++k)
    sticking += modes_.switches[k].kind == Switch::Kind::stiction && modes_.mode[k] == active;
  return sticking == 1;
}

// Loads at quarters of the step: at its ends, and between them on the cubic through both ends and their rates.
GuardMonitor::Loads GuardMonitor::interpolated_loads(const Guard& guard) {
  const Point &start = point(0), &end = point(1);
  if (interpolated_.empty()) {
    const double h = step_->t1 - step_->t;
    Numbers move(s_.ny), x(s_.ny);
    s_.difference(start.y.data(), end.y.data(), move.data());
    for (int k = 1; k < 4; ++k) {
      const double a = static_cast<double>(k) / 4, b = 1 - a;
      Point p{a, step_->t + a * h, Numbers(s_.length)};
      for (int i = 0; i < s_.ny; ++i) x[i] = a * a * (a + 3 * b) * move[i] + h * a * b * (b * start.F[i] - a * end.F[i]);
      s_.add(start.y.data(), x.data(), p.y.data());
      p.F.resize(s_.ny), p.lam.resize(s_.ng);
      s_.derivative(p.t, p.y.data(), p.F.data(), p.lam.data());
      interpolated_.push_back(std::move(p));
    }
  }
  Loads out{load(guard, start), 0, 0, 0, load(guard, end)};
  for (int k = 1; k < 4; ++k) out[k] = load(guard, interpolated_[k - 1]);
  return out;
}

GuardMonitor::Loads GuardMonitor::loads_of_steps(const Guard& guard) {
  Loads out;
  for (int k = 0; k < 5; ++k) out[k] = load(guard, point(static_cast<double>(k) / 4));
  return out;
}

double GuardMonitor::unresolved(const Guard& guard) {
  const double h = step_->t1 - step_->t;
  if (guard.kind == Guard::range_boundary)
    return std::pow(h / std::min(longest_step(guard, point(0)), longest_step(guard, point(1))), 4);
  if (!guard.has_load()) return 0;
  const bool slips = guard.kind == Guard::slip;
  const double fourth[5] = {1, -4, 6, -4, 1};
  const Loads loads = interpolated_loads(guard);
  double most = 0, least = INFINITY, bend = 0, terms = 0;
  for (int k = 0; k < 5; ++k) {
    const double x = loads[k];
    most = std::max(most, std::fabs(x)), least = std::min(least, x);
    bend += fourth[k] * x, terms += std::fabs(fourth[k]);
  }
  bend = std::fabs(bend);
  if (!slips && !(bend > terms * s_.mechanics.limits.solution_rounding * point(0).force)) return 0;
  const double size = slips ? 1 : std::max(most, s_.mechanics.limits.visible * guard.size);
  const double distance = slips ? 1 - most : least / (size > 0 ? size : 1);
  return bend / (size * modes_.rough * std::max(distance >= 0 ? distance : 1.0, modes_.near_limit));
}

// Fractions of the step, in order, at which a guard may be negative: with loads, extrema of the quartic through them,
// too, and only where it is close to the limit.
std::vector<double> GuardMonitor::samples(int i) {
  const Guard& guard = modes_.guards[i];
  std::vector<double> quarters{1, 2, 3, 4};
  if (guard.has_load()) {
    const bool own = has_own_load(guard);
    const Loads loads = own ? interpolated_loads(guard) : loads_of_steps(guard);
    const double size = largest(loads.data(), 5);
    const Interpolant quartic(loads);
    const auto far = [&](double x) {
      const double f = quartic.value(x);
      return guard.kind == Guard::slip ? !(std::fabs(f) > 1 - modes_.close_extremum)
                                       : !(f < modes_.close_extremum * (size > 0 ? size : 1));
    };
    for (double x : quartic.extrema(-4 * modes_.outside, 4 * (1 + modes_.outside)))
      if (!far(x)) quarters.push_back(4 * std::clamp(x / 4, 0.0, 1.0));
    if (own) quarters.erase(std::remove_if(quarters.begin(), quarters.end(), far), quarters.end());
  }
  std::sort(quarters.begin(), quarters.end());
  for (double& x : quarters) x /= 4;
  return quarters;
}

double GuardMonitor::negative_fraction(int i) {
  const Guard& guard = modes_.guards[i];
  if (guard.needs_multipliers()) {
    for (double theta : samples(i))
      if (theta > 0 && at(theta, i).f < -rounding(i)) return theta;
    return 0;
  }
  const double h = step_->t1 - step_->t, share = (guard.return_time - step_->t) / h;
  const Value end = at(1, i);
  if (end.f < -rounding(i)) return 1;
  if (0 < share && share < 1 && at(share, i).f < -rounding(i)) return share;
  if (!has_rate(guard) || !(end.rate > 0)) return 0;
  const Value start = at(0, i);
  if (!(start.rate < 0)) return 0;
  const Cubic cubic(start.f, end.f, h * start.rate, h * end.rate);
  if (cubic.minimum() > modes_.grazing * std::min(start.f, end.f)) return 0;
  const auto rate = [&](double theta) { return at(theta, i).rate; };
  const double small = modes_.coincident;
  const double theta = brent(rate, 0, start.rate, 1, end.rate, small, small, modes_.root_iterations);
  return at(theta, i).f < -rounding(i) ? theta : 0;
}

double GuardMonitor::time_tolerance() const {
  const double scale = std::max(std::fabs(step_->t), std::fabs(step_->t1));
  return modes_.spacings * (std::nextafter(scale, INFINITY) - scale) / (step_->t1 - step_->t);
}

double GuardMonitor::locate(int i, double high) {
  if (!has_rate(modes_.guards[i])) return dynamic_ ? locate_by_loads(i, high) : locate_by_brent(i, high);
  const double h = step_->t1 - step_->t, tolerance = time_tolerance();
  const Value start = at(0, i), end = at(high, i);
  const bool starts_at_zero = start.f <= rounding(i);
  const double low = starts_at_zero ? modes_.start_root * high : 0;
  double theta = high * Cubic(std::max(start.f, 0.0), end.f, high * h * start.rate, high * h * end.rate).first_zero();
  double nearest = 0, best = INFINITY;
  for (int k = 0; k < modes_.iterations && low < theta && theta < high; ++k) {
    const Value x = at(theta, i);
    if (!(x.rate < 0) || !(std::fabs(x.f) < best)) {
      if (best <= rounding(i) && !starts_at_zero) return nearest;
      break;
    }
    const double move = x.f / (h * x.rate);
    if (std::fabs(move) <= tolerance + modes_.step_tolerance * theta) return theta;
    nearest = theta, best = std::fabs(x.f), theta -= move;
  }
  return locate_by_brent(i, high);
}

// From the root of the quartic through five values: its derivative, then roots of the polynomial through all values of
// steps.
double GuardMonitor::locate_by_loads(int i, double high) {
  const double tolerance = time_tolerance();
  const Guard& guard = modes_.guards[i];
  Interpolant of_steps;
  Loads values;
  if (has_own_load(guard)) {
    values = interpolated_loads(guard);
    for (double& x : values) x = (guard.kind == Guard::slip ? 1 - std::fabs(x) : x) - guard.level;
    for (double theta : {0.0, 1.0}) of_steps.add(4 * theta, at(theta, i).f);
    if (high < 1) of_steps.add(4 * high, at(high, i).f);
  } else {
    for (int k = 0; k < 5; ++k) of_steps.add(k, values[k] = at(static_cast<double>(k) / 4, i).f);
  }
  const Interpolant quartic(values);
  double theta = quartic.first_zero(4 * high) / 4, best = INFINITY, nearest = 0;
  if (!(at(0, i).f > rounding(i))) return locate_by_brent(i, high);
  for (int k = 0; k < modes_.iterations && 0 < theta && theta < high; ++k) {
    const double f = at(theta, i).f;
    if (std::fabs(f) < best) of_steps.add(4 * theta, f);
    const double gradient = (of_steps.size() < 4 ? quartic : of_steps).derivative(4 * theta);
    if (!(gradient < 0) || !(std::fabs(f) < best)) {
      if (best <= rounding(i)) return nearest;
      break;
    }
    const double root = (of_steps.size() < 4 ? 4 * theta - f / gradient : of_steps.root(4 * theta, NEWTON_STEPS)) / 4;
    if (!(std::fabs(root - theta) > tolerance + modes_.step_tolerance * theta)) return theta;
    nearest = theta, best = std::fabs(f), theta = root;
  }
  return locate_by_brent(i, high);
}

// A guard that is zero at the start is divided by theta, which gives its mean rate.
double GuardMonitor::locate_by_brent(int i, double high) {
  const bool starts_at_zero = at(0, i).f <= rounding(i);
  const auto value = [&](double theta) { return at(theta, i).f / (starts_at_zero ? theta : 1); };
  double low = 0;
  if (starts_at_zero) {
    low = 0.5 * high;
    for (int k = 2; k < modes_.max_halvings && !(at(low, i).f > 0); ++k) low *= 0.5;
    if (!(at(low, i).f > 0)) leave_to_python();
  }
  return brent(value, low, value(low), high, value(high), time_tolerance(), modes_.step_tolerance,
               modes_.root_iterations);
}

int GuardMonitor::first_root(double& theta) {
  const int n = static_cast<int>(modes_.guards.size());
  std::vector<std::pair<int, double>> candidates;
  for (int i = 0; i < n; ++i)
    if (const double high = negative_fraction(i); high > 0) candidates.emplace_back(i, high);
  int first = -1;
  while (!candidates.empty()) {  // guards that cross zero before theta
    const int i = candidates.front().first;
    const double root = locate(i, candidates.front().second);
    if (first >= 0 && !(root < theta - 4 * time_tolerance())) leave_to_python();  // together
    theta = root, first = i, candidates.clear();
    for (int k = 0; k < n; ++k)
      if (k != first && at(theta, k).f < -rounding(k)) candidates.emplace_back(k, theta);
  }
  return first;
}

}  // namespace mbdae
