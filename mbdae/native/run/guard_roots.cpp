#include <algorithm>
#include <cmath>

#include "math/brent.hpp"
#include "math/vec3.hpp"
#include "run/mode_guards.hpp"

namespace mbdae {

namespace {

// The cubic with values f and derivatives m at 0 and 1: c[3] + c[2] x + c[1] x^2 + c[0] x^3.
struct Cubic {
  Cubic(double f0, double f1, double m0, double m1)
      : c{2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1, m0, f0} {}

  double value(double x) const { return c[3] + x * (c[2] + x * (c[1] + x * c[0])); }

  // Whether it has a minimum in (0, 1), where the derivative is positive at 1.
  bool has_minimum() const {
    return c[2] < 0 || (c[1] < 0 && c[0] > 0 && c[1] * c[1] > 3 * c[0] * c[2] && -c[1] < 3 * c[0]);
  }
  double minimum() const {
    const double root = std::sqrt(std::max(0.0, c[1] * c[1] - 3 * c[0] * c[2]));
    return value(c[1] >= 0 ? -c[2] / (c[1] + root) : (root - c[1]) / (3 * c[0]));
  }
  double steepest() const { return c[2] < 0 ? 0 : -c[1] / (3 * c[0]); }  // where it falls, before the minimum

  // The first zero in (0, 1), or that of the cubic over x if it is zero at 0; 1 if there is none.
  double first_zero() const {
    const bool starts_at_zero = c[3] == 0;
    const auto f = [&](double x) { return starts_at_zero ? c[2] + x * (c[1] + x * c[0]) : value(x); };
    // extrema, between which it is monotonic
    const double a = starts_at_zero ? 0 : 3 * c[0], b = starts_at_zero ? 2 * c[0] : 2 * c[1];
    const double d = starts_at_zero ? c[1] : c[2];
    double ends[3] = {1, 1, 1};
    if (a == 0) {
      ends[0] = -d / b;
    } else if (b * b >= 4 * a * d) {
      const double sum = -0.5 * (b + std::copysign(std::sqrt(b * b - 4 * a * d), b));
      ends[0] = sum / a, ends[1] = d / sum;
    }
    for (double& x : ends)
      if (!(0 < x && x < 1)) x = 1;
    std::sort(ends, ends + 3);
    double low = 0;
    for (double high : ends) {
      if (f(low) > 0 && !(f(high) > 0)) {
        for (double x = 0.5 * (low + high); low < x && x < high; x = 0.5 * (low + high)) (f(x) > 0 ? low : high) = x;
        return low;
      }
      low = high;
    }
    return 1;
  }

  const double c[4];
};

// The quartic through values at 0, 1, 2, 3, 4, by divided differences.
class Quartic {
 public:
  explicit Quartic(const double* values) {
    std::copy(values, values + 5, d_);
    for (int n = 1; n < 5; ++n)
      for (int k = 4; k >= n; --k) d_[k] = (d_[k] - d_[k - 1]) / n;
  }

  double value(double x) const {
    double f = d_[4];
    for (int n = 3; n >= 0; --n) f = d_[n] + (x - n) * f;
    return f;
  }
  double derivative(double x) const {
    double f = d_[4], df = 0;
    for (int n = 3; n >= 0; --n) df = f + (x - n) * df, f = d_[n] + (x - n) * f;
    return df;
  }

 private:
  double d_[5];
};

// A change of the sign of f between low and high, by bisection.
template <class Function>
double bisect(Function&& f, double low, double high) {
  const bool positive = f(low) > 0;
  for (double x = 0.5 * (low + high); low < x && x < high; x = 0.5 * (low + high))
    ((f(x) > 0) == positive ? low : high) = x;
  return low;
}

}  // namespace

double GuardMonitor::begin_step(const AcceptedStep& step, const PartialStep& shorter) {
  step_ = &step, shorter_ = &shorter, known_.clear();
  if (!referenced_) prepare();
  double worst = 0;
  for (const Guard& guard : modes_.guards) worst = std::max(worst, unresolved(guard));
  return worst;
}

double GuardMonitor::longest_step(const Guard& guard, const Point& p) const {
  const Switch& x = of(guard);
  const double scale = s_.mechanics.limits.coordinate_scales[x.column];
  return x.shortest / std::max(std::fabs(p.y[s_.nq + x.column]), s_.mechanics.limits.zero_speed * speed(p) * scale);
}

double GuardMonitor::unresolved(const Guard& guard) {
  const double h = step_->t1 - step_->t;
  if (guard.kind == Guard::range_boundary)
    return std::pow(h / std::min(longest_step(guard, point(0)), longest_step(guard, point(1))), 4);
  if (!guard.has_load()) return 0;
  const bool slips = guard.kind == Guard::slip;
  const double fourth[5] = {1, -4, 6, -4, 1};
  double most = 0, least = INFINITY, bend = 0, terms = 0;
  for (int k = 0; k < 5; ++k) {
    const double x = load(guard, point(static_cast<double>(k) / 4));
    most = std::max(most, std::fabs(x)), least = std::min(least, x);
    bend += fourth[k] * x, terms += std::fabs(fourth[k]);
  }
  bend = std::fabs(bend);
  if (!slips && !(bend > terms * s_.mechanics.limits.solution_rounding * point(0).force)) return 0;
  const double size = slips ? 1 : std::max(most, s_.mechanics.limits.visible * guard.size);
  const double distance = slips ? 1 - most : least / (size > 0 ? size : 1);
  return bend / (size * modes_.rough * std::max(distance >= 0 ? distance : 1.0, modes_.near_limit));
}

std::vector<double> GuardMonitor::samples(int i) {
  const Guard& guard = modes_.guards[i];
  std::vector<double> out;
  for (int k = 1; k < 5; ++k) out.push_back(static_cast<double>(k) / 4);
  if (!guard.has_load()) return out;
  double loads[5], size = 0;
  for (int k = 0; k < 5; ++k) {
    loads[k] = load(guard, point(static_cast<double>(k) / 4));
    size = std::max(size, std::fabs(loads[k]));
  }
  const Quartic quartic(loads);
  const auto derivative = [&](double x) { return quartic.derivative(x); };
  const double first = -4 * modes_.outside, last = 4 * (1 + modes_.outside), move = 1.0 / 8;
  for (double x = first; x < last; x += move) {
    const double high = std::min(x + move, last);
    if ((derivative(x) > 0) == (derivative(high) > 0)) continue;
    const double low = bisect(derivative, x, high), extremum = quartic.value(low);
    const bool close = guard.kind == Guard::slip ? std::fabs(extremum) > 1 - modes_.close_extremum
                                                 : extremum < modes_.close_extremum * (size > 0 ? size : 1);
    if (close) out.push_back(std::clamp(low / 4, 0.0, 1.0));
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
  const double h = step_->t1 - step_->t, share = (guard.return_time - step_->t) / h;
  const Value end = at(1, i);
  if (end.f < -rounding(i)) return 1;
  if (0 < share && share < 1 && at(share, i).f < -rounding(i)) return share;
  if (!has_rate(guard) || !(end.rate > 0)) return 0;
  const Value start = at(0, i);
  const Cubic cubic(start.f, end.f, h * start.rate, h * end.rate);
  if (!cubic.has_minimum() || cubic.minimum() > modes_.grazing * std::min(start.f, end.f)) return 0;
  const auto rate = [&](double theta) { return at(theta, i).rate; };
  const double small = modes_.coincident, falling = cubic.steepest(), steepest = rate(falling);
  if (!(steepest < 0)) return 0;
  const double theta = brent(rate, falling, steepest, 1, end.rate, small, small, modes_.root_iterations);
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

// Secants, from the root of the quartic through five values on.
double GuardMonitor::locate_by_loads(int i, double high) {
  const double tolerance = time_tolerance();
  double values[5];
  for (int k = 0; k < 5; ++k) values[k] = at(static_cast<double>(k) / 4, i).f;
  const Quartic quartic(values);
  const auto value = [&](double x) { return quartic.value(x); };
  double low = 0, theta = 0;  // low: in quarters of the step
  for (double next = 0; theta == 0 && low < 4 * high; low = next) {
    next = std::min(low + 1.0 / 8, 4 * high);
    if (value(low) > 0 && !(value(next) > 0)) theta = bisect(value, low, next) / 4;
  }
  if (!(values[0] > rounding(i)) || theta == 0) return locate_by_brent(i, high);
  double gradient = 4 * quartic.derivative(4 * theta), best = INFINITY, before = 0, nearest = 0;
  for (int k = 0; k < modes_.iterations && 0 < theta && theta < high; ++k) {
    const double f = at(theta, i).f;
    if (k) gradient = (f - before) / (theta - nearest);
    if (!(gradient < 0) || !(std::fabs(f) < best)) {
      if (best <= rounding(i)) return nearest;
      break;
    }
    const double move = f / gradient;
    if (std::fabs(move) <= tolerance + modes_.step_tolerance * theta) return theta;
    nearest = theta, before = f, best = std::fabs(f), theta -= move;
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
