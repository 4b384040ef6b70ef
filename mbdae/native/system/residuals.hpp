// What a run keeps or should keep, at any point (mbdae/solution/columns.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// g and G v + g_t over all rows, (ng,) each, at y = (q, v, ...); M, J and poses stand at q then. Nothing is counted.
void residual(Index2System& s, double t, const double* y, double* g, double* rate);

struct Energy {
  double kinetic, potential;  // J
};
Energy energy(Index2System& s, const double* y);  // where M and poses stand at q

}  // namespace mbdae
