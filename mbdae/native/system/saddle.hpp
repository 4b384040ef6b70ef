// The saddle-point system M v' = f + G^T lam, Ghat v' = rhs of the rows in use, by its Schur complement
// S = Ghat M^-1 G^T = Zhat Z^T.
#pragma once

#include <vector>

#include "system/independent_rows.hpp"
#include "system/configuration.hpp"

namespace mbdae {

class SaddleSystem {
 public:
  SaddleSystem(const Configuration& point, const Constraints& constraints, IndependentRows& rows, const Tolerances& limits,
               Counts& counts, int nv);

  void factorize(const Vector& Zhat);  // S
  // After `factorize`: rhs (ng,) by row becomes lam, f (nv,) becomes v'.
  void solve(const Vector& Zhat, double* rhs, double* f);
  // The same without `counts`, for further right-hand sides; `use_selection_factors`: with
  // the factors of the row selection, in place of those of `factorize`.
  void solve_uncounted(const Vector& Zhat, double* rhs, double* f, bool use_selection_factors = false);
  // The same with current Z, by any factors of G M^-1 G^T that exist or will be needed.
  void solve_uncounted(double* rhs, double* f);
  const BandLU& factors() const { return lu_; }  // of S
  void factorize_symmetric();                    // factorize G M^-1 G^T with current Z, unless those are the factors
  bool factorize_symmetric(double least_ratio);  // the same; false where the ratio of its pivots is not above this one
  // out = M^-1 G^T S^-1 r (nv,), r (ng,) by row: for S = G M^-1 G^T the x of minimum norm in the mass metric with G x = r.
  // If requested, the multipliers S^-1 r (ng,) by row, too.
  void minimum_norm_correction(const double* r, double* out, double* multipliers = nullptr);
  // After `factorize_symmetric`:
  bool remaining_rows_dependent(const Vector& probe);  // on those in use? Tested with one vector (nv,)
  // Updates lam (ng,) of the rows in use by the dlam that minimizes |M^-1/2 (residual + G^T dlam)|; residual (nv,) is
  // overwritten.
  void update_multipliers(double* residual, double* lam);
  // Multipliers of all rows (ng,) from those in use, of minimum norm.
  void all_multipliers(const double* lam, double* z);

 private:
  struct Entry {
    int i, j;
    double s;
  };
  struct Block {  // a row in use, and up to four with which it is coupled, that have the same columns
    int i, n, j[4];                       // positions
    size_t start, starts[4];              // of their entries
    size_t first, last;                   // of `common_`
  };
  template <int n, bool symmetric>
  void multiply(const Block& block, const double* Zhat);  // entries of S, as independent sums
  void build_coupling_blocks();        // `blocks_`
  void assemble(const Vector& Zhat);   // S of the rows in use

  const Configuration& point_;
  const Constraints& constraints_;
  IndependentRows& rows_;
  const Tolerances& limits_;
  Counts& counts_;
  const int nv_;
  BandLU lu_;                          // of S, (r, r)
  std::vector<Block> blocks_;
  std::vector<Constraints::Common> common_;
  long symmetric_stamp_ = -1;          // the stamp of the point whose Z Z^T is factorized
  long version_ = -1;                  // of the rows that set its size
  Vector x_;                           // (max(nv, r),) right-hand side, and solution
  Vector rhs_;                         // (ng,) by row: right-hand side for iterative refinement, while joints stick
  std::vector<Entry> couplings_;       // of Z_others Z_in_use^T, (ng - r, r)
  Vector u_, n_, residual_, p_, Ap_;   // conjugate gradients: (r,), and (ng - r,) four times
};

}  // namespace mbdae
