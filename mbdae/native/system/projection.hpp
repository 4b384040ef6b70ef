// Projection of a state onto its closures, optional at the ends of steps
// (mbdae/mechanism/formulations/steps/projection.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// Whether G v + g_t (ng,) exceeds rounding; any nonzero value counts if joints stick.
bool exceeds_rounding(const Index2System& system, const double* rate, const double* v);

// Whether v misses rows of G v + g_t = 0 at the current point; without g_t, that of drivers, all have v = 0 in common.
bool violates_velocity_constraints(const Index2System& system, double t, const double* v);

// Adds characteristic lengths and the largest speed to component magnitudes of y, (ny,): `characteristic_magnitudes`.
void add_characteristic_magnitudes(const Index2System& system, const double* y, double* magnitudes);

// The largest component of a move, relative to `ratio` times these magnitudes.
double largest_move(const Vector& move, const Vector& magnitudes, int measured, double ratio, double tiny);

// y becomes the nearest point with g = 0 and G v + g_t = 0; all configurations on the way except the last.
void project_state(Index2System& system, double t, double* y, std::vector<Vector>* path = nullptr);

}  // namespace mbdae
