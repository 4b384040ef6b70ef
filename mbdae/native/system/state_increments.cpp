// Sums y (+) x and differences of states y = (q, v, s, w), with tangent vectors (x, v, s, w), and their magnitudes.
#include <cmath>

#include "system/index2.hpp"

namespace mbdae {

void Index2System::move(const State& in, double* x, State& out) const {
  for (size_t k = 0; k < in.low.size(); ++k) x[k] += in.low[k];
  manifold.check_rotations(x);
  out.y.resize(length), out.low.assign(ny, 0.0);
  add(in.y.data(), x, out.y.data());
  for (int k = manifold.flat ? 0 : nv; k < ny; ++k) {
    const int i = k < nv ? k : k - nv + nq;
    out.low[k] = x[k] - (out.y[i] - in.y[i]);
  }
}

void Index2System::add(const double* y, const double* x, double* out) const {
  manifold.integrate(y, x, out);
  for (int i = 0; i < nv + ns + 1; ++i) out[nq + i] = y[nq + i] + x[nv + i];
}

void Index2System::difference(const double* y0, const double* y1, double* out) const {
  manifold.difference(y0, y1, out);
  for (int i = 0; i < nv + ns + 1; ++i) out[nv + i] = y1[nq + i] - y0[nq + i];
}

void Index2System::component_magnitudes(const double* y, double* out) {
  manifold.component_magnitudes(y, out);
  for (int i = 0; i < nv + ns + 1; ++i) out[nv + i] = std::fabs(y[nq + i]);
  if (!driven()) return;
  tree.inertia(y);  // kinetic energy: scale for the work of drivers
  out[ny - 1] += tree.kinetic_energy(y + nq);
}

}  // namespace mbdae
