// Accelerations at a stage, and their derivative in raw coordinates.
#include "steps/index1.hpp"

#include <algorithm>

#include "math/vec3.hpp"

namespace mbdae {

void Index1Step::stage(double t, double, double, double* F, bool) {
  set_stage_state();
  s_.point.evaluate(q_.data(), true, v_.data());
  std::copy(v_.begin(), v_.end(), F);
  s_.manifold.tangent(x_.data(), F);
  s_.accelerate(t, q_.data(), v_.data(), s_in_.data(), F + nv_, F + 2 * nv_, true);
  lam_ = s_.multipliers();
}

void Index2System::raw_derivative(double t, const double* y, double* dy, double* z) {
  Vector normalized(y, y + length), F(ny);
  if (!manifold.flat) tree.normalize(normalized.data());
  derivative(t, normalized.data(), F.data(), z);
  std::copy(F.begin() + nv, F.end(), dy + nq);
  if (manifold.flat)
    std::copy_n(F.begin(), nv, dy);
  else
    tree.tangent_map(normalized.data(), F.data(), dy);
}

}  // namespace mbdae
