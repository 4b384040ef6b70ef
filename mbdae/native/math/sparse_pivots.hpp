// Pivots of sparse rows: rank and independent rows of mechanisms with many closures, fast for chains.
#pragma once

#include <utility>
#include <vector>

#include "math/factorizations.hpp"

namespace mbdae {

// Sparse symmetric matrix S = B^T B by rows: (column, entry) in order, of both triangles.
using SparseRow = std::vector<std::pair<int, double>>;

// The order of up to `count` pivots and their decreasing magnitudes, as |diag R| of `pivoted_qr` of B; pivots at or
// below `smallest` times the largest entry are omitted. Cholesky elimination, accurate to the square root of rounding,
// with diagonal pivoting among the first `window` remaining rows of a sequence: pivoting among all rows would cause
// fill-in.
void sparse_pivots(const std::vector<SparseRow>& S, const std::vector<int>& sequence, int window, int count,
                   double smallest, std::vector<int>& order, Vector& pivots);

}  // namespace mbdae
