// Projection of a state on its closures, as an option at the ends of steps
// (mbdae/mechanism/formulations/projection.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// Whether G v + g_t (ng,) is more than rounding; whatever it is where joints stick.
bool felt(const Index2System& system, const double* rate, const double* v);

// y becomes the nearest point with g = 0 and G v + g_t = 0; the configurations on the way, but for the last.
void restore(Index2System& system, double t, double* y, std::vector<Numbers>* path = nullptr);

}  // namespace mbdae
