// Collocation steps, Radau IIA (mbdae/methods/collocation.py, mbdae/mechanism/formulations/steps/implicit_stage.py).
#pragma once

#include <complex>
#include <memory>
#include <vector>

#include "math/fields.hpp"
#include "system/index2.hpp"

namespace mbdae {

struct EigenMode {  // eigenvalue of A with its vectors: A x = Re sum column value (row . x)
  std::complex<double> value;
  std::vector<std::complex<double>> column, row;  // (s,)

  FIELDS(value, column, row)
};

// Coefficients of a method with s stages, and the thresholds of its iteration.
struct Radau {
  Vector c, A;  // (s,), (s, s) by rows
  std::vector<EigenMode> modes;
  int real = -1;  // index of the real eigenvalue; -1: none
  double gamma = 0;
  Vector start;    // error estimates: F minus these combinations of stages, (1 or 2, s) by rows
  int middle = 0;  // the stage at which partials are evaluated
  int max_iterations = 0,
      max_iterations_controlled = 0;  // for a fixed step; for a step that may be shortened
  int extra_iterations = 0;           // largest number of iterations after a change close to rounding
  int first_iterations = 0;           // number of iterations after the first one
  double below_rounding = 0, iteration_rounding = 0, negligible = 0;  // mbdae/tolerances.py
  double expected_rate = 0, reuse = 0;  // contraction rates: initial value; largest rate at which partials are reused
  int s = 0, errors = 0;                // stages, and error estimates

  FIELDS(c, A, modes, real, gamma, start, middle, max_iterations, max_iterations_controlled, extra_iterations,
         first_iterations, below_rounding, iteration_rounding, negligible, expected_rate, reuse)
};

class StageSolver;

// Partials at a point, in the coordinates of a step.
struct LinearizedStages {
  EquationPartials partials;
  std::vector<TangentBlock> tangents;
  Vector P, N = {};  // for GGL, (k, nv): positional rows in use, and M^-1 P^T by columns
};

// Data that a step passes to the next one.
struct StageMemory {
  std::vector<int> unknowns;
  double h = 0, rate = 0;
  Vector K, Z;  // (s, ny), (s, m) by rows
  std::shared_ptr<const LinearizedStages> partials;
  std::vector<std::shared_ptr<const StageSolver>> solvers;
};

// Evaluate the collocation polynomial at the nodes of a step of size h that starts `delay` later: its initial guess.
std::shared_ptr<StageMemory> resample(const Radau& a, const StageMemory& m, double delay, double h);

class CollocationStep {
 public:
  explicit CollocationStep(Index2System& system);
  virtual ~CollocationStep();

  // Step from t to t + h: state, lam of the method (ng,) and, if controlled, error estimates (errors, ny).
  void take(const Radau& a, bool controlled, double t, double h, const State& in, State& out, double* z,
            Vector& errors);

 protected:
  // R (ny,) and C (m,) of a stage at x (ny,) with x' and z (m,): lam of the rows in use, and further multipliers of a
  // formulation.
  virtual void residual(double t, const double* x, const double* dx, const double* z, double* R, double* C);
  virtual std::vector<int> unknowns() const;  // rows of z, (m,): rows in use first
  virtual void begin_step(const double*) {}   // a step begins at y (length,)
  virtual void all_multipliers(double t, const double* z, double* out);  // (nz,) at the end of a step; lam_ is current

  virtual std::shared_ptr<const LinearizedStages> linearize(double t, const double* x, const double* dx,
                                                            const double* z);
  std::vector<std::shared_ptr<const StageSolver>> factorize(const Radau& a,
                                                            const std::shared_ptr<const LinearizedStages>& partials,
                                                            double h);
  void correction(const Radau& a, double t, const StageMemory& m);  // set dK_ and dZ_ of an iteration
  // Enlarge scale_, the magnitudes of y plus its change, none below a fraction of the largest.
  void enlarge_scale(const Radau& a, const Vector& displacements);
  // Iterate to rounding, or to an accuracy > 0; false: no convergence with these partials and this h.
  bool solve(const Radau& a, int max_iterations, double accuracy, double t, StageMemory& m);

  Index2System& s_;
  const int nq_, nv_, ns_, ny_;
  Vector y0_, size_;                                    // (length,), (ny,) at the start of the step
  Vector q_, u_, f_, inertial_, G_, gt_, lam_, rates_;  // scratch
  Vector scale_, X_, R_, dK_, displacements_, C_, dZ_;          // (ny,), (s, ny) four times, (s, r) twice
  Vector dk_, dz_, work_;                               // (2, ny), (2, r)
};

}  // namespace mbdae
