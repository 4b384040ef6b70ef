// Pivots of sparse rows: the ranks and independent rows of many closures, in a time that is short for chains.
#pragma once

#include <utility>
#include <vector>

#include "math/factorizations.hpp"

namespace mbdae {

// Sparse symmetric matrix S = B^T B by rows: (column, entry) in order, of the whole matrix.
using SparseRow = std::vector<std::pair<int, double>>;

// The order of up to `count` pivots, and their magnitudes, decreasing, as |diag R| of `pivots` of B; those at or below
// `smallest` of the largest entry are omitted. By Cholesky's elimination, accurate to the square root of rounding, with
// diagonal pivoting among the first `window` rows of a sequence that are left: pivoting among all of them would couple
// all in the end. S is overwritten.
void sparse_pivots(std::vector<SparseRow>& S, const std::vector<int>& sequence, int window, int count, double smallest,
                   std::vector<int>& order, Vector& pivots);

}  // namespace mbdae
