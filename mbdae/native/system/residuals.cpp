// Constraint residuals, kinetic and potential energy.
#include "system/residuals.hpp"

#include <algorithm>

namespace mbdae {

void residual(Index2System& s, double t, const double* y, double* g, double* rate) {
  const double* v = y + s.nq;
  s.tree.inertia(y);
  s.point.invalidate();
  s.constraints.value(s.tree, y, s.constraints.all, s.point.G.data(), g);
  s.constraints.complete_g(t, g);
  std::fill(rate, rate + s.ng, 0.0);
  s.constraints.evaluate_g_t(t, rate);
  for (int k = 0; k < s.ng; ++k)
    rate[k] = s.constraints.times(k, s.point.G, v, rate[k]);
}

Energy energy(Index2System& s, const double* y) {
  return {s.tree.kinetic_energy(y + s.nq), s.potential(y)};
}

double Index2System::potential(const double* q) {
  double out = tree.potential();
  for (const Law& law : laws_)
    if (law.kind->potential) out += law.kind->potential(law, {tree, 0.0, q, nullptr, nullptr});
  return out;
}

}  // namespace mbdae
