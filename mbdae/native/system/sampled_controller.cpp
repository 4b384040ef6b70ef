// Sampling instants, PID controllers, and the inputs that controllers set.
#include "system/sampled_controller.hpp"

#include <algorithm>
#include <cmath>

#include "system/index2.hpp"
#include "math/vec3.hpp"

namespace mbdae {

double SampledController::next(double t) const {
  return offset + (std::floor((t - offset) * rate + coincide) + 1) / rate;
}

bool SampledController::has_jumped(double t, double late) const {
  const double scale = std::max(std::fabs(t), std::fabs(offset)), rounding = std::nextafter(scale, INFINITY) - scale;
  return t - (offset + std::nearbyint((t - offset) * rate) / rate) > late * rounding;
}

void SampledController::sample(double t, const double* y, int nq, int nv, double* after) const {
  const double k = (t - offset) * rate;
  if (std::fabs(k - std::nearbyint(k)) > coincide) return;
  const double* s = y + nq + nv + state;
  if (kind == python) return call(t, y, y + nq, y + nq + nv, after);
  const double error = reference.at(t) - y[x];
  const double derivative = a[2] != 0 ? a[2] * (reference.at(t, 1) - y[v]) : 0.0;
  after[0] = a[0] * error + derivative + (states > 1 ? a[1] * s[1] : 0.0);
  if (states > 1) after[1] = s[1] + error * (1 / rate);
}

void Index2System::apply_jumps(double t, double* y, double late) {
  const Vector before(y, y + length);
  for (const SampledController& x : samplers)
    if (!x.has_jumped(t, late)) x.sample(t, before.data(), nq, nv, y + nq + nv + x.state);
  if (!finite(y, length)) throw FallBackToPython();
  const double* s = y + nq + nv;
  for (const SampledController& x : samplers)
    for (const HeldInput& u : x.inputs)
      u.rate < 0 ? set_input(u.input, t, s[u.value], 0) : set_input(u.input, s[u.instant], s[u.value], s[u.rate]);
}

}  // namespace mbdae
