#include "run/jumps.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

double Jumps::next(const std::vector<SampledController>& samplers, double t, double sign) const {
  double out = sign * INFINITY;
  if (sign > 0) {
    const auto after = std::upper_bound(times.begin(), times.end(), t);
    if (after != times.end()) out = *after;
    for (const SampledController& x : samplers) out = std::min(out, x.next(t));
  } else {
    const auto before = std::lower_bound(times.begin(), times.end(), t);
    if (before != times.begin()) out = *(before - 1);
  }
  return out;
}

// The last of the jumps after t that follow one another within `gap`; t if there is none.
bool Jumps::last_of_cluster(const std::vector<SampledController>& samplers, double t, double sign, double gap,
                            double& found) const {
  for (int i = 0; i < max_cluster; ++i) {
    const double later = next(samplers, t, sign);
    if (sign * (later - t) > gap) {
      found = t;
      return true;
    }
    t = later;
  }
  return false;
}

bool Jumps::next_interval(const std::vector<SampledController>& samplers, double t, SmoothInterval& interval) {
  const double s = interval.sign, scale = std::max(std::fabs(t), std::fabs(interval.t1));
  const double rounding = std::nextafter(scale, INFINITY) - scale, gap = margin * rounding, cluster = late() * rounding;
  double from, after;
  if (!last_of_cluster(samplers, t, s, cluster, from)) return false;
  const double first = next(samplers, from, s), stop = first - s * gap;
  const double ahead = s * (first - interval.t1);
  const bool coincide = std::isfinite(first) && next(samplers, interval.t1, s) != first;  // seen from t1
  if (ahead > cluster && !coincide) {
    interval.stop = interval.end = interval.t1, restart = NAN;
  } else if (ahead >= -cluster) {  // a run that continues begins with the jump: stop differs from end
    interval.stop = s * std::min(s * stop, s * std::nextafter(interval.t1, -s * INFINITY));
    interval.end = interval.t1, restart = NAN;
  } else {
    if (!last_of_cluster(samplers, first, s, cluster, after)) return false;
    interval.stop = interval.end = stop, restart = s > 0 ? after : after - gap;
  }
  interval.t = t;
  return true;
}

}  // namespace mbdae
