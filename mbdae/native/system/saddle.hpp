// The saddle-point system M v' = f + G^T lam, Ghat v' = rhs of the rows in use, by its Schur complement
// S = Ghat M^-1 G^T = Zhat Z^T.
#pragma once

#include <vector>

#include "system/independent_rows.hpp"
#include "system/configuration.hpp"

namespace mbdae {

class SaddleSystem {
 public:
  SaddleSystem(const Configuration& point, const Constraints& constraints, IndependentRows& rows,
               const Tolerances& tolerances, Counts& counts, int nv);

  void factorize(const Vector& Zhat);  // factorize S
  // After `factorize`: replace rhs (ng,), an entry for each row, by lam, and f (nv,) by v'.
  void solve(const Vector& Zhat, double* rhs, double* f);
  // Solve without counting, for further right-hand sides; use_selection_factors: with the factors of the row selection
  // instead of those of `factorize`.
  void solve_uncounted(const Vector& Zhat, double* rhs, double* f, bool use_selection_factors = false);
  // Solve with current Z, by any available factors of G M^-1 G^T.
  void solve_uncounted(double* rhs, double* f);
  const BandLU& factors() const { return lu_; }  // of S
  void factorize_symmetric();                    // factorize G M^-1 G^T with current Z, unless it is factorized
  bool factorize_symmetric(double smallest_ratio);  // false: its pivot ratio is not larger
  // out = M^-1 G^T S^-1 r (nv,), r (ng,) by row: for S = G M^-1 G^T the minimum-norm x in the mass metric with G x = r.
  // If requested, also the multipliers S^-1 r (ng,) by row.
  void minimum_norm_correction(const double* r, double* out, double* multipliers = nullptr);
  // After `factorize_symmetric`: project a vector (nv,) onto the null space of Z of the rows in use.
  void project_onto_null_space(Vector& w);
  // After `factorize_symmetric`:
  bool remaining_rows_dependent(const Vector& probe);  // tested with one vector (nv,)
  // Update lam (ng,) of the rows in use by the dlam that minimizes |M^-1/2 (residual + G^T dlam)|; overwrites residual
  // (nv,).
  void update_multipliers(double* residual, double* lam);
  // Minimum-norm multipliers of all rows (ng,) from those of the rows in use.
  void all_multipliers(const double* lam, double* z);

 private:
  struct Entry {
    int i, j;
    double s;
  };
  struct Block {                          // a row in use, and up to four rows coupled with it that have equal columns
    int i, n, j[4];                       // positions
    size_t start, starts[4];              // first entries
    size_t first, last;                   // range in `common_runs_`
  };
  template <int n, bool symmetric>
  void multiply(const Block& block, const double* Zhat);  // entries of S, as independent sums
  void build_coupling_blocks();                           // set `blocks_`
  void assemble(const Vector& Zhat);                      // assemble S of the rows in use

  const Configuration& point_;
  const Constraints& constraints_;
  IndependentRows& rows_;
  const Tolerances& tolerances_;
  Counts& counts_;
  const int nv_;
  BandLU lu_;                          // of S, (r, r)
  std::vector<Block> blocks_;
  std::vector<Constraints::CommonRun> common_runs_;
  long symmetric_stamp_ = -1;          // stamp of the point whose Z Z^T is factorized
  long version_ = -1;                  // version of the rows in use
  Vector x_;                           // (max(nv, r),) right-hand side, and solution
  Vector rhs_;                         // (ng,) by row: right-hand side for iterative refinement, while joints stick
  std::vector<Entry> couplings_;       // of Z Z^T between remaining rows and rows in use, (ng - r, r)
  Vector u_, n_, residual_, p_, Ap_;   // conjugate gradients: (r,), and (ng - r,) four times
};

}  // namespace mbdae
