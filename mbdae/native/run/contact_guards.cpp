#include "run/contact_guards.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// The cubic with values f and derivatives m at 0 and 1: c[3] + c[2] x + c[1] x^2 + c[0] x^3.
struct Cubic {
  Cubic(double f0, double f1, double m0, double m1) : c{2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1, m0, f0} {}

  double value(double x) const { return c[3] + x * (c[2] + x * (c[1] + x * c[0])); }

  double minimum(int intervals) const {  // over equidistant points of [0, 1]
    double out = INFINITY;
    for (int k = 0; k <= intervals; ++k) out = std::min(out, value(static_cast<double>(k) / intervals));
    return out;
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
  for (const ContactGuard& guard : all.guards) rows_.push_back(guard.row);
  G_.assign(static_cast<size_t>(s.ng) * s.nv, 0.0), Z_ = G_;
}

double ContactMonitor::rounding(int i) const {
  const Tolerances& limits = s_.mechanics.limits;
  return limits.evaluation_rounding * (limits.row_scales[rows_[i]] + all_.guards[i].size);
}

ContactMonitor::Gaps ContactMonitor::gaps(double t, const double* y) {
  const AllRowsActive all(s_.constraints);
  Numbers g(s_.ng, 0.0), g_t(s_.ng, 0.0);
  s_.mechanics.poses(y);
  s_.constraints.value(s_.mechanics, y, rows_, G_.data(), g.data());
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
  if (!(cubic.minimum(8) > all_.grazing * std::min(start.f, end.f))) leave_to_python();
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
  leave_to_python();
}

int ContactMonitor::first_root(const AcceptedStep& step, const PartialStep& shorter, double& theta) {
  step_ = &step, shorter_ = &shorter, known_.clear();
  std::vector<std::pair<int, double>> candidates;
  for (size_t i = 0; i < rows_.size(); ++i) {
    const double high = negative_fraction(static_cast<int>(i));
    if (high > 0) candidates.emplace_back(static_cast<int>(i), high);
  }
  int first = -1;
  while (!candidates.empty()) {  // guards that cross zero before theta
    const int i = candidates.front().first;
    const double root = locate(i, candidates.front().second);
    if (first >= 0 && !(root < theta - 4 * time_tolerance())) leave_to_python();  // together
    theta = root, first = i, candidates.clear();
    for (int k = 0; k < static_cast<int>(rows_.size()); ++k)
      if (k != first && at(theta, k).f < -rounding(k)) candidates.emplace_back(k, theta);
  }
  return first;
}

void ContactMonitor::advance() {
  for (size_t i = 0; i < rows_.size(); ++i) {
    ContactGuard& guard = all_.guards[i];
    const double f = at(1, static_cast<int>(i)).f + guard.level;
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

void ContactMonitor::track(double t, const double* y, const double* F) {
  const Gaps now = gaps(t, y);
  for (size_t i = 0; i < rows_.size(); ++i) {
    ContactGuard& guard = all_.guards[i];
    const double f = now.value[i], speed = now.rate[i];
    guard.size = std::fabs(f), guard.level = std::min(0.0, f), guard.return_time = NAN;
    if (!(f <= rounding(static_cast<int>(i)) && speed > 0)) continue;
    const double a = gap_acceleration(static_cast<int>(i), y, F);
    if (a < 0) guard.return_time = t - all_.return_factor * 2 * speed / a;
  }
}

Numbers ContactMonitor::all_impulses(const Numbers& in_use) const {
  Numbers out(s_.ng, 0.0);
  for (int k : s_.rows.in_use()) out[k] = in_use[k];
  if (!s_.rows.dependent()) return out;
  const std::vector<double>& scales = s_.mechanics.limits.row_scales;
  const size_t nv = s_.nv, ng = s_.ng;
  Numbers impulse(nv, 0.0), columns(nv * ng), scaled(ng);
  for (size_t k = 0; k < ng; ++k)
    for (int c : s_.constraints.rows[k].columns) {
      const double z = s_.point.Z[k * nv + c];
      columns[c * ng + k] = z / scales[k], impulse[c] += z * out[k];
    }
  minimum_norm(s_.ng, s_.nv, columns.data(), impulse.data(), s_.mechanics.limits.truncation, scaled.data());
  for (size_t k = 0; k < ng; ++k) out[k] = scaled[k] / scales[k];
  return out;
}

Rebound ContactMonitor::rebound(int i, double t, double* y) {
  const Tolerances& limits = s_.mechanics.limits;
  const ContactGuard& guard = all_.guards[i];
  const int row = guard.row, nv = s_.nv;
  const double scale = limits.row_scales[row], e = guard.restitution;
  double* v = y + s_.nq;
  const auto largest_speed = [&] { return all_.characteristic_rate + largest_scaled(v, limits.coordinate_scales); };
  const Gaps before = gaps(t, y);
  for (size_t k = 0; k < rows_.size(); ++k)  // this contact alone is closed
    if ((before.value[k] <= limits.solution_rounding * limits.row_scales[rows_[k]]) != (static_cast<int>(k) == i))
      leave_to_python();
  const double approach = before.rate[i], speed = largest_speed();
  if (!(e > 0) || std::fabs(t - guard.last_impact) < guard.rest) leave_to_python();
  if (!(approach < -all_.mode_rounding * speed * scale)) leave_to_python();

  Numbers rate(s_.ng), x(nv), closing(s_.ng, 0.0), opening(s_.ng, 0.0), normal(nv, 0.0);
  s_.residual_rate(t, v, rate.data());
  if (!(largest_scaled(rate.data(), limits.row_scales) <= limits.visible * speed)) leave_to_python();
  for (int c : s_.constraints.rows[row].columns) normal[c] = guard.sign * G_[static_cast<size_t>(row) * nv + c];
  s_.point.scale_row(row, G_, Z_);
  const double* z = &Z_[static_cast<size_t>(row) * nv];
  double free = 0;  // |M^-1/2 n|^2
  for (int c : s_.constraints.rows[row].columns) free += z[c] * z[c];
  s_.saddle.factorize_symmetric();
  Numbers unit(normal);
  s_.saddle.solve_uncounted(opening.data(), unit.data());  // velocities that a unit impulse causes
  const double compliance = dot(normal.data(), unit.data(), nv);
  if (!(compliance > limits.truncation * limits.truncation * free)) leave_to_python();

  Rebound out{-1, i, 0, Numbers(s_.ng, 0.0)};
  const Numbers start(v, v + nv);
  for (int k = 0; k < 2; ++k) {  // the second time, rounding is removed
    const double now = k ? dot(normal.data(), v, nv) : approach;
    if (k) s_.residual_rate(t, v, rate.data());
    s_.saddle.factorize_symmetric();
    s_.saddle.minimum_norm_motion(rate.data(), x.data(), closing.data());
    const double p = (-e * approach - (now - dot(normal.data(), x.data(), nv))) / compliance;
    for (int c = 0; c < nv; ++c) v[c] += p * unit[c] - x[c];
    for (int row_in_use : s_.rows.in_use()) out.impulses[row_in_use] += p * opening[row_in_use] - closing[row_in_use];
    out.impulses[row] += guard.sign * p;
  }
  Numbers force(normal);
  for (double& f : force) f *= guard.sign * out.impulses[row];
  for (int k : s_.rows.in_use())
    for (int c : s_.constraints.rows[k].columns) force[c] += out.impulses[k] * s_.point.G[static_cast<size_t>(k) * nv + c];
  for (int c = 0; c < nv; ++c) out.work += 0.5 * force[c] * (start[c] + v[c]);
  y[s_.length - 1] += out.work;
  if (!(e * -approach > all_.mode_rounding * largest_speed() * scale) || !finite(y, s_.length)) leave_to_python();
  const double impulse = out.impulses[row];
  out.impulses = all_impulses(out.impulses), out.impulses[row] = impulse;
  return out;
}

}  // namespace mbdae
