// The next smooth interval between jumps, or clusters of them.
#include "run/jumps.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

double Jumps::next(const std::vector<SampledController>& samplers, double t, double sign) const {
  double out = sign * INFINITY;
  if (sign > 0) {
    const auto later = std::upper_bound(times.begin(), times.end(), t);
    if (later != times.end()) out = *later;
    for (const SampledController& x : samplers) out = std::min(out, x.next(t));
  } else {
    const auto earlier = std::lower_bound(times.begin(), times.end(), t);
    if (earlier != times.begin()) out = *(earlier - 1);
  }
  return out;
}

// Find the last jump of the cluster that begins after t, where jumps are at most `gap` apart; t: none.
bool Jumps::last_of_cluster(const std::vector<SampledController>& samplers, double t, double sign, double gap,
                            double& last) const {
  for (int i = 0; i < max_cluster; ++i) {
    const double later = next(samplers, t, sign);
    if (sign * (later - t) > gap) {
      last = t;
      return true;
    }
    t = later;
  }
  return false;
}

bool Jumps::next_interval(const std::vector<SampledController>& samplers, double t, SmoothInterval& interval) {
  const double s = interval.sign, scale = std::max(std::fabs(t), std::fabs(interval.t1));
  const double rounding = std::nextafter(scale, INFINITY) - scale, gap = margin * rounding,
               cluster = cluster_width() * rounding;
  double start, end;
  if (!last_of_cluster(samplers, t, s, cluster, start)) return false;
  const double first = next(samplers, start, s), stop = first - s * gap;
  const double distance = s * (first - interval.t1);
  const bool coincide = std::isfinite(first) && next(samplers, interval.t1, s) != first;  // t1 is in the cluster
  if (distance > cluster && !coincide) {
    interval.stop = interval.end = interval.t1, restart = NAN;
  } else if (distance >= -cluster) {  // a continued run begins with the jump: stop differs from end
    interval.stop = s * std::min(s * stop, s * std::nextafter(interval.t1, -s * INFINITY));
    interval.end = interval.t1, restart = NAN;
  } else {
    if (!last_of_cluster(samplers, first, s, cluster, end)) return false;
    interval.stop = interval.end = stop, restart = s > 0 ? end : end - gap;
  }
  interval.t = t;
  return true;
}

}  // namespace mbdae
