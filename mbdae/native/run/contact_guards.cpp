#include "run/contact_guards.hpp"

#include <algorithm>
#include <cmath>

#include "math/brent.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

// The cubic with values f and derivatives m at 0 and 1: c[3] + c[2] x + c[1] x^2 + c[0] x^3.
struct Cubic {
  Cubic(double f0, double f1, double m0, double m1)
      : c{2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1, m0, f0} {}

  double value(double x) const { return c[3] + x * (c[2] + x * (c[1] + x * c[0])); }

  double minimum() const {  // where the derivative is negative at 0 and positive at 1
    const double root = std::sqrt(std::max(0.0, c[1] * c[1] - 3 * c[0] * c[2]));
    return value(c[1] >= 0 ? -c[2] / (c[1] + root) : (root - c[1]) / (3 * c[0]));
  }

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

}  // namespace

ContactMonitor::ContactMonitor(Index2System& s, ContactGuards& all) : s_(s), all_(all) {
  if (!all.in_core) return;
  for (const ContactGuard& guard : all.guards) rows_.push_back(guard.row), loaded_ |= guard.closed;
  evaluated_ = rows_;
  for (const ContactGuard& guard : all.guards)
    if (guard.no_slip >= 0) evaluated_.push_back(guard.no_slip);
  G_.assign(static_cast<size_t>(s.ng) * s.nv, 0.0), Z_ = G_;
}

double ContactMonitor::rounding(int i) const {
  return s_.mechanics.limits.evaluation_rounding * (all_.guards[i].unit + all_.guards[i].size);
}

ContactMonitor::Gaps ContactMonitor::gaps(double t, const double* y) {
  const AllRowsActive all(s_.constraints);
  Numbers g(s_.ng, 0.0), g_t(s_.ng, 0.0);
  s_.mechanics.poses(y);
  s_.constraints.value(s_.mechanics, y, evaluated_, G_.data(), g.data());
  s_.constraints.complete_g(t, g.data());
  s_.constraints.evaluate_g_t(t, g_t.data());
  Gaps out{0, Numbers(rows_.size()), Numbers(rows_.size())};
  for (size_t i = 0; i < rows_.size(); ++i) {
    const int k = rows_[i];
    double rate = g_t[k];
    for (int c : s_.constraints.rows[k].columns) rate += G_[static_cast<size_t>(k) * s_.nv + c] * y[s_.nq + c];
    out.value[i] = all_.guards[i].sign * g[k], out.rate[i] = all_.guards[i].sign * rate;
  }
  return out;
}

ContactMonitor::Value ContactMonitor::at(double theta, int i) {
  auto found = std::find_if(known_.begin(), known_.end(), [&](const Gaps& x) { return x.theta == theta; });
  if (found == known_.end()) {
    const Numbers y = theta == 0 || theta == 1 ? Numbers() : (*shorter_)(theta);
    const double* point = theta == 0 ? step_->y : theta == 1 ? step_->y1 : y.data();
    known_.push_back(gaps(step_->t + theta * (step_->t1 - step_->t), point));
    found = known_.end() - 1, found->theta = theta;
  }
  return {found->value[i] - all_.guards[i].level, found->rate[i]};
}

double ContactMonitor::negative_fraction(int i) {
  const double h = step_->t1 - step_->t, share = (all_.guards[i].return_time - step_->t) / h;
  const Value end = at(1, i);
  if (end.f < -rounding(i)) return 1;
  if (0 < share && share < 1 && at(share, i).f < -rounding(i)) return share;
  if (!(end.rate > 0)) return 0;
  const Value start = at(0, i);
  if (!(start.rate < 0)) return 0;
  const Cubic cubic(start.f, end.f, h * start.rate, h * end.rate);
  if (!(cubic.minimum() > all_.grazing * std::min(start.f, end.f))) leave_to_python();
  return 0;
}

double ContactMonitor::time_tolerance() const {
  const double scale = std::max(std::fabs(step_->t), std::fabs(step_->t1));
  return all_.spacings * (std::nextafter(scale, INFINITY) - scale) / (step_->t1 - step_->t);
}

double ContactMonitor::locate(int i, double high) {
  const double h = step_->t1 - step_->t, tolerance = time_tolerance();
  const Value start = at(0, i), end = at(high, i);
  const bool starts_at_zero = start.f <= rounding(i);
  const double low = starts_at_zero ? all_.start_root * high : 0;
  double theta = high * Cubic(std::max(start.f, 0.0), end.f, high * h * start.rate, high * h * end.rate).first_zero();
  double nearest = 0, best = INFINITY;
  for (int k = 0; k < all_.iterations && low < theta && theta < high; ++k) {
    const Value x = at(theta, i);
    if (!(x.rate < 0) || !(std::fabs(x.f) < best)) {
      if (best <= rounding(i) && !starts_at_zero) return nearest;
      break;
    }
    const double move = x.f / (h * x.rate);
    if (std::fabs(move) <= tolerance + all_.step_tolerance * theta) return theta;
    nearest = theta, best = std::fabs(x.f), theta -= move;
  }
  return locate_by_brent(i, high);
}

// A guard that is zero at the start is divided by theta, which gives its mean rate.
double ContactMonitor::locate_by_brent(int i, double high) {
  const bool starts_at_zero = at(0, i).f <= rounding(i);
  const auto value = [&](double theta) { return at(theta, i).f / (starts_at_zero ? theta : 1); };
  double low = 0;
  if (starts_at_zero) {
    low = 0.5 * high;
    for (int k = 2; k < all_.max_halvings && !(at(low, i).f > 0); ++k) low *= 0.5;
    if (!(at(low, i).f > 0)) leave_to_python();
  }
  return brent(value, low, value(low), high, value(high), time_tolerance(), all_.step_tolerance, all_.root_iterations);
}

double ContactMonitor::load_rounding(const double* y, const double* F, const double* lam) {
  const int nv = s_.nv;
  const double* a = F + nv;
  Numbers inertial(nv, 0.0), reaction(nv, 0.0);
  s_.mechanics.inertia(y);
  for (int k = 0; k < nv; ++k) {
    const double* M = s_.mechanics.M() + static_cast<size_t>(k) * nv;
    inertial[k] += M[k] * a[k];
    for (int i : s_.mechanics.ancestors[k]) inertial[k] += M[i] * a[i], inertial[i] += M[i] * a[k];
  }
  for (int k = 0; k < s_.ng; ++k)
    for (int c : s_.constraints.rows[k].columns) reaction[c] += s_.point.G[static_cast<size_t>(k) * nv + c] * lam[k];
  return s_.mechanics.limits.solution_rounding * (largest(inertial.data(), nv) + largest(reaction.data(), nv));
}

double ContactMonitor::unresolved(int i, const double* load, double rounding) const {
  const double fourth[5] = {1, -4, 6, -4, 1};
  double size = s_.mechanics.limits.visible * all_.guards[i].size, least = INFINITY, bend = 0, terms = 0;
  for (int k = 0; k < 5; ++k) {
    size = std::max(size, std::fabs(load[k])), least = std::min(least, load[k]);
    bend += fourth[k] * load[k], terms += std::fabs(fourth[k]);
    if (k && load[k] < -this->rounding(i)) leave_to_python();
  }
  // the quartic through the samples, by their differences, at x from the first of them
  double d[5];
  std::copy(load, load + 5, d);
  for (int n = 1; n < 5; ++n)
    for (int k = 4; k >= n; --k) d[k] = (d[k] - d[k - 1]) / n;
  for (double x = -4 * all_.outside; x <= 4 * (1 + all_.outside); x += 1.0 / 8) {
    const double value = d[0] + x * (d[1] + (x - 1) * (d[2] + (x - 2) * (d[3] + (x - 3) * d[4])));
    if (value < all_.close_extremum * size) leave_to_python();
  }
  bend = std::fabs(bend);
  if (!(bend > terms * rounding)) return 0;
  const double distance = least / (size > 0 ? size : 1);
  return bend / (size * all_.rough * std::max(distance >= 0 ? distance : 1.0, all_.near_limit));
}

double ContactMonitor::check_loads(const AcceptedStep& step, const PartialStep& shorter) {
  step_ = &step, shorter_ = &shorter, known_.clear();
  if (!loaded_) return INFINITY;
  const size_t n = rows_.size();
  Numbers loads(5 * n), F(s_.ny), lam(s_.ng);
  double rounding = 0, worst = 0;
  for (int k = 0; k < 5; ++k) {
    const double theta = static_cast<double>(k) / 4, t = step.t + theta * (step.t1 - step.t);
    const Numbers y = k % 4 ? shorter(theta) : Numbers();
    const double* at = !k ? step.y : k == 4 ? step.y1 : y.data();
    s_.derivative(t, at, F.data(), lam.data());
    if (!k) rounding = load_rounding(at, F.data(), lam.data());
    for (size_t i = 0; i < n; ++i) loads[5 * i + k] = all_.guards[i].sign * lam[rows_[i]];
  }
  end_loads_.resize(n);
  for (size_t i = 0; i < n; ++i) {
    end_loads_[i] = loads[5 * i + 4];
    if (all_.guards[i].closed) worst = std::max(worst, unresolved(static_cast<int>(i), &loads[5 * i], rounding));
  }
  if (worst > 1) leave_to_python();
  if (!(worst > 0)) return INFINITY;
  const double factor = std::max(all_.shrink, all_.safety * std::pow(worst, -1.0 / 4));
  return std::max(all_.shortest, (step.t1 - step.t) * factor);
}

int ContactMonitor::first_root(double& theta) {
  std::vector<std::pair<int, double>> candidates;
  for (int i = 0; i < static_cast<int>(rows_.size()); ++i) {
    const double high = all_.guards[i].closed ? 0 : negative_fraction(i);
    if (high > 0) candidates.emplace_back(i, high);
  }
  int first = -1;
  while (!candidates.empty()) {  // guards that cross zero before theta
    const int i = candidates.front().first;
    const double root = locate(i, candidates.front().second);
    if (first >= 0 && !(root < theta - 4 * time_tolerance())) leave_to_python();  // together
    theta = root, first = i, candidates.clear();
    for (int k = 0; k < static_cast<int>(rows_.size()); ++k)
      if (k != first && !all_.guards[k].closed && at(theta, k).f < -rounding(k)) candidates.emplace_back(k, theta);
  }
  return first;
}

void ContactMonitor::advance() {
  for (size_t i = 0; i < rows_.size(); ++i) {
    ContactGuard& guard = all_.guards[i];
    const double f = guard.closed ? end_loads_[i] : at(1, static_cast<int>(i)).f + guard.level;
    guard.size = std::max(guard.size, std::fabs(f));
    if (f >= 0) guard.level = 0;
  }
}

double ContactMonitor::gap_acceleration(int i, const double* y, const double* F) {
  const AllRowsActive all(s_.constraints);
  const int k = rows_[i];
  Numbers gamma(s_.ng, 0.0), g_tt(s_.ng, 0.0);
  s_.mechanics.motions(y, y + s_.nq);
  s_.constraints.bias(s_.mechanics, y, y + s_.nq, {k}, gamma.data());
  double out = gamma[k];
  for (int c : s_.constraints.rows[k].columns) out += G_[static_cast<size_t>(k) * s_.nv + c] * F[s_.nv + c];
  return all_.guards[i].sign * out;
}

void ContactMonitor::track(double t, const double* y, const double* F, const double* lam) {
  const Tolerances& limits = s_.mechanics.limits;
  const double largest_force = loaded_ ? load_rounding(y, F, lam) / limits.solution_rounding : 0;
  const Gaps now = gaps(t, y);
  for (int i = 0; i < static_cast<int>(rows_.size()); ++i) {
    ContactGuard& guard = all_.guards[i];
    const double f = guard.closed ? guard.sign * lam[guard.row] : now.value[i], speed = now.rate[i];
    guard.unit = guard.closed ? largest_force : limits.row_scales[guard.row];
    guard.size = std::fabs(f), guard.level = guard.closed ? 0 : std::min(0.0, f), guard.return_time = NAN;
    if (guard.closed || !(f <= rounding(i) && speed > 0)) continue;
    const double a = gap_acceleration(i, y, F);
    if (a < 0) guard.return_time = t - all_.return_factor * 2 * speed / a;
  }
}

}  // namespace mbdae
