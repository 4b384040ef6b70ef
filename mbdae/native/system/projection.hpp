// Projection of states onto the closures, optional at the ends of steps
// (mbdae/mechanism/formulations/steps/projection.py).
#pragma once

#include "system/index2.hpp"

namespace mbdae {

// Whether G v + g_t (ng,) exceeds rounding; any nonzero value counts if joints stick.
bool exceeds_rounding(const Index2System& system, const double* rate, const double* v);

// Whether v violates G v + g_t = 0 at the current point; if g_t = 0, v = 0 satisfies all rows, and the result is false.
bool violates_velocity_constraints(const Index2System& system, double t, const double* v);

// Add characteristic lengths and the largest speed to the component magnitudes of y, (ny,).
void add_characteristic_magnitudes(const Index2System& system, const double* y, double* magnitudes);

// The largest of the first n components of a displacement, relative to `ratio` times the magnitudes.
double largest_move(const Vector& displacement, const Vector& magnitudes, int n, double ratio, double tiny);

// Project y onto g = 0 and G v + g_t = 0. tight: to rounding, for states near singular configurations; path: all
// iterates of q except the last.
void project_state(Index2System& system, double t, double* y, bool tight = false, std::vector<Vector>* path = nullptr);

}  // namespace mbdae
