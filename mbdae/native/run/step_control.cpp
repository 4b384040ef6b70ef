// Step proposals, error norm, and the step-size controller.
#include "run/step_control.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

bool StepControl::propose(const SmoothInterval& interval, Proposal& p) {
  const double remaining = std::fabs(interval.stop - interval.t);
  p.h = std::min(h, largest);
  uncut_size = p.h > remaining ? h : 0.0;
  if (p.h >= remaining * (1 - agreement)) {
    p = {remaining, interval.end};
    return true;
  }
  if (!large_enough(interval, p.h)) return false;
  p.t_next = interval.t + interval.sign * p.h;
  return true;
}

bool StepControl::large_enough(const SmoothInterval& interval, double size) const {
  const double t = std::max(std::fabs(interval.t), std::fabs(interval.t1));
  return size >= spacings * (std::nextafter(t, INFINITY) - t);
}

double StepControl::error_norm(const double* e, int errors, int ny, int n, const double* size0, const double* size1,
                               int from, int to, double noise) const {
  double norms[2] = {0, 0};
  for (int i = 0; i < errors && i < 2; ++i) {
    double s = 0;
    for (int k = 0; k < n; ++k) {
      double scale = atol[atol.size() == 1 ? 0 : k] + rtol * std::max(size0[k], size1[k]) + tiny;
      if (k >= from && k < to) scale += noise;
      const double x = e[static_cast<size_t>(i) * ny + k] / scale;
      s += x * x;
    }
    norms[i] = std::sqrt(s / n);
  }
  if (errors == 1 || norms[0] == 0) return norms[0];
  const double denominator = std::pow(norms[0], blend) + companion * std::pow(norms[1], blend);
  return norms[0] * norms[0] / std::pow(denominator, 1 / blend);
}

double StepControl::next_step(double taken, double error) {
  if (!(error <= 1)) {
    rejected = true;
    const double shrink = std::isfinite(error) ? safety * std::pow(error, -1 / power) : 0.0;
    return taken * std::max(smallest_factor, shrink);
  }
  error = std::max(error, smallest_error);
  double factor = safety * std::pow(error, exponent) * std::pow(last, last_exponent);
  factor = std::min(rejected ? 1.0 : largest_factor, std::max(smallest_factor, factor));
  if (factor > 1 && factor <= min_growth) factor = 1;
  last = std::max(error, smallest_last), rejected = false;
  return taken * factor;
}

double Grid::at(const SmoothInterval& interval, long k) const {
  return k >= n ? interval.t1 : t0 + interval.sign * k * step;
}

Proposal Grid::propose(const SmoothInterval& interval) {
  const bool started = on_grid;
  const double remaining = std::fabs(interval.stop - interval.t), t = at(interval, i + 1);
  const double overshoot = interval.sign * (t - interval.stop);
  on_grid = overshoot <= coincident * step;
  i += on_grid;
  const double spacing = std::nextafter(std::fabs(interval.end), HUGE_VAL) - std::fabs(interval.end);
  if (started && interval.stop == interval.end && std::fabs(remaining - step) <= 4 * spacing)
    return {step, interval.end};
  if (overshoot >= -coincident * step) return {remaining, interval.end};
  return {started ? step : std::fabs(t - interval.t), t};
}

void Grid::undo_step() { i -= on_grid, on_grid = false; }

bool Grid::more_before_end(const SmoothInterval& interval) const {
  return on_grid && i < n && interval.sign * (interval.stop - at(interval, i + 1)) >= 0;
}

}  // namespace mbdae
