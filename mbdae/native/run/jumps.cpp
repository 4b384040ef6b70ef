#include "run/jumps.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

double Jumps::next(const std::vector<SampledController>& samplers, double t, double sign) const {
  double out = sign * INFINITY;
  if (sign > 0) {
    const auto behind = std::upper_bound(times.begin(), times.end(), t);
    if (behind != times.end()) out = *behind;
    for (const SampledController& x : samplers) out = std::min(out, x.next(t));
  } else {
    const auto before = std::lower_bound(times.begin(), times.end(), t);
    if (before != times.begin()) out = *(before - 1);
  }
  return out;
}

// The last of the jumps after t that follow one another within `near`; t if there is none.
bool Jumps::last(const std::vector<SampledController>& samplers, double t, double sign, double near, double& found) const {
  for (int i = 0; i < crowd; ++i) {
    const double later = next(samplers, t, sign);
    if (sign * (later - t) > near) {
      found = t;
      return true;
    }
    t = later;
  }
  return false;
}

bool Jumps::leg(const std::vector<SampledController>& samplers, double t, SmoothInterval& leg) {
  const double s = leg.sign, scale = std::max(std::fabs(t), std::fabs(leg.t1));
  const double stay = margin * (std::nextafter(scale, INFINITY) - scale);
  double from, behind;
  if (!last(samplers, t, s, 4 * stay, from)) return false;
  const double first = next(samplers, from, s), stop = first - s * stay;
  if (s * (first - leg.t1) > 4 * stay) {
    leg.stop = leg.end = leg.t1, restart = NAN;
  } else if (s * (leg.t1 - first) <= 4 * stay) {
    leg.stop = stop, leg.end = leg.t1, restart = NAN;
  } else {
    if (!last(samplers, first, s, 4 * stay, behind)) return false;
    leg.stop = leg.end = stop, restart = s > 0 ? behind : behind - stay;
  }
  leg.t = t;
  return true;
}

}  // namespace mbdae
