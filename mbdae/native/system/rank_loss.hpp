// Null spaces of the rows and of their transpose near singular configurations, in linear time for many rows
// (mbdae/mechanism/formulations/rank_loss.py). None of these evaluations is counted.
#pragma once

#include <vector>

#include "system/index2.hpp"

namespace mbdae {

// Replace vectors (nv,) by velocities with G v = 0 at q: projections onto the null space of G M^-1/2, times M^-1/2.
void admissible_velocities(Index2System& system, const double* q, std::vector<Vector>& vectors);

// Project vectors (ng,) onto the null space of G^T at q: the combinations of rows that vanish. Return the number of
// independent rows: at most `rank`, with pivots above `limit` times the largest.
int vanishing_combinations(Index2System& system, const double* q, int rank, double limit, std::vector<Vector>& vectors);

// The largest |g| of all rows, relative to the largest entry of G, after Gauss-Newton steps from q by the independent
// rows, with pivots above `limit` times the largest.
double residual_of_dependent_rows(Index2System& system, double t, const double* q, double limit, int steps);

}  // namespace mbdae
