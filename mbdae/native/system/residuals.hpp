// Residuals and energies at any point (mbdae/solution/columns.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// g and G v + g_t of all rows, (ng,) each, at y = (q, v, ...); updates M, J and poses at q. Not counted.
void residual(Index2System& s, double t, const double* y, double* g, double* rate);

struct Energy {
  double kinetic, potential;  // J
};
Energy energy(Index2System& s, const double* y);  // requires current M and poses at q

}  // namespace mbdae
