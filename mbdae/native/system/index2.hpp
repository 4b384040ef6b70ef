// The equations of a mechanism in index-2 descriptor form, with their workspace
// (mbdae/mechanism/formulations/index2.py).
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "system/independent_rows.hpp"
#include "mechanism/laws.hpp"
#include "mechanism/manifold.hpp"
#include "mechanism/multibody_tree.hpp"
#include "system/configuration.hpp"
#include "mechanism/rows.hpp"
#include "system/saddle.hpp"
#include "system/sampled_controller.hpp"
#include "system/closure_friction.hpp"

namespace mbdae {

struct StageMemory;  // collocation.hpp

struct State {
  Vector y;           // (nq + nv + ns + 1,): q, v, s, w
  Vector carry, low;  // (nv + ns + 1,): v', s', w', and (ny,): the rounding error of y; both may be empty
  std::shared_ptr<StageMemory> memory;  // carry of a collocation method, or null
};

// Partials of (f + G^T lam - M v', h, power) and of G v + g_t at a point, by rows; n = nv + ns + 1
// (mbdae/mechanism/formulations/equation_partials.py).
struct EquationPartials {
  Vector M, K, D, G, B;  // (nv, nv), (n, nv) d/dq, (n, n) d/d(v, s, w), (r, nv), (r, nv) d(G v)/dq
  Vector g_t;            // (r,)
  Vector friction;       // (r, nv + 1) d(f, power)/dlam due to friction; empty: no friction
};

// Constraints that steps satisfy: index2: G v + g_t = 0; ggl: also g = 0, by a second multiplier; index1: only the
// hidden constraint of accelerations (mbdae/mechanism/formulations/).
enum class Formulation { index2, ggl, index1 };
inline constexpr const char* enumerators(Formulation) { return "index2, ggl, index1"; }

// Description of a mechanism from Python.
struct Description {
  Formulation formulation = Formulation::index2;
  double alpha = 0, beta = 0;  // 1/s, of Baumgarte's stabilization
  bool flat = false;
  std::vector<Row> rows;
  std::vector<std::pair<Anchor, Anchor>> pairs, law_pairs;
  std::vector<Driver> drivers;
  std::vector<Law> laws;
  int ns = 0;
  std::vector<GroupJoint> group_joints;
  std::vector<int> angular;  // (nv,) flags of rotations
  std::vector<int> order;    // (ng,) position of each row in the order of elimination
  Vector probe;             // (nv,) in general position, of unit variance
  std::vector<ModalBody> flexible;

  FIELDS(formulation, alpha, beta, flat, ns, pairs, rows, drivers, law_pairs, laws, group_joints, angular, order,
         probe, flexible)
};

class Index2System {
 public:
  Index2System(const void* model, const Tolerances& tolerances, Description d);

  MultibodyTree tree;
  Constraints constraints;
  Manifold manifold;
  Counts counts;
  IndependentRows rows;
  Configuration point;
  SaddleSystem saddle;
  ClosureFriction friction;
  const Formulation formulation;
  const int nq, nv, ng, ns, nz;    // nz: multipliers of a method, lam and mu
  const int ny, length;            // sizes of the tangent (x, v, s, w), and of y
  // largest scaled |g|, |G v + g_t| and |v| at the ends of steps
  double largest_g = 0, largest_rate = 0, largest_speed = 0;
  double accuracy = 0;  // relative accuracy of Newton's method in controlled collocation steps; 0: rounding

  int carry_length() const { return formulation == Formulation::ggl ? ny : ny - nv; }  // size of the carry
  Vector carry(const Vector& F) const;  // from y' (ny,), for methods with an explicit first stage
  bool driven() const { return !constraints.drivers.empty(); }
  int controlled_components() const { return driven() ? ny : ny - 1; }  // components under error control
  // After `saddle.factorize_symmetric`: test whether the remaining rows are still dependent.
  void probe_other_rows();
  void select_rows_of_step(const double* y);  // select rows for a step from y (length,), unless they are frozen
  void use_rows(const std::vector<int>& in_use, int rank, double floor, bool frozen);
  void reset();  // to the state of a new system, in the same mode
  // Write the parameters of a mechanism of the same structure in place, and `reset`; false: its structure differs.
  bool write(const void* model, const Tolerances& tolerances, Description d);
  bool remaining_rows_dependent(const double* q, double tolerance);  // see `IndependentRows`; not counted
  void determine_rows(const double* q, const IndependentRows::InitialRank& first);  // at the start of a run
  bool change_law(int k, const Vector& a);                                          // replace the parameters of law k
  size_t law_size(int k) const { return k < 0 || k >= static_cast<int>(laws_.size()) ? 0 : laws_[k].a.size(); }
  // parameter i of law k; beyond the last one, the offset of its potential; nullptr: none
  double* law_parameter(int k, int i);
  bool update_parameters();  // after changes of parameters in place; false: they are invalid
  void set_input(int input, double t, double value, double rate);  // to value + rate (t' - t)
  Vector joint_friction;  // (ng,) friction of slipping joints, as multipliers of their inactive rows
  // Set the inactive rows of the mode (ng,), and whether joints stick; afterwards the rows in use must be set.
  void deactivate_rows(std::vector<bool> inactive, bool has_sticking_joints);

  // f (nv,) and the rates (s', power in W), (ns + 1,); requires current kinematics at q, and if `biased` nle at (q, v).
  void forces(double t, const double* q, const double* v, const double* s, double* f, double* rates,
              bool biased = false);
  // tau (nv,) of all laws, and the rates; requires current kinematics at q.
  void generalized_force(double t, const double* q, const double* v, const double* s, double* tau, double* rates);
  // Partials at a point with v' (nv,) and lam (ng,) by row; requires the expanded tree, updates J and poses.
  void partials(double t, const double* q, const double* u, const double* vdot, const double* lam, EquationPartials& out);
  // Only K, D and g_t, and if requested B (r, nv) and wrenches: of laws between frames, then of closures, summed over
  // rows.
  void force_partials(double t, const double* q, const double* u, const double* vdot, const double* lam,
                      EquationPartials& out, Vector* B = nullptr, std::vector<LawWrench>* wrenches = nullptr);
  // Partials of all laws with respect to (q, v, s): of conservative and of other forces, (nv, width) each, and of s',
  // (ns, width), width = 2 nv + ns; requires current kinematics at q. Valid until the next call.
  const double* law_partials(double t, const double* q, const double* v, const double* s,
                             std::vector<LawWrench>* wrenches = nullptr);
  // The partial time derivative (n,) of f, s' and power, the rows of K, at a point with lam (ng,); requires current
  // kinematics at q.
  void time_partials(double t, const double* q, const double* u, const double* lam, double* out);
  // If requested: add d(G^T lam)/dq with lam (ng,) to K (nv, nv); write d(G v)/dq to B (r, nv) by rows, and the
  // partials of rows in use to wrench_partials (ng,). Requires current J and poses at q. other_rows: instead of the
  // rows in use.
  void closure_partials(const double* q, const double* v, const double* lam, double* K, Vector* B,
                        std::vector<LawWrench>* wrenches = nullptr,
                        std::vector<WrenchPartials>* wrench_partials = nullptr,
                        const IndependentRows* other_rows = nullptr);
  // Replace rhs (ng,) by lam and f (nv,) by v', and add the power of friction; requires current G, and slip directions
  // of closure friction.
  void solve(const Vector& Zhat, double* rhs, double* f, double* power);
  // v' (nv,) and the rates from the hidden constraint; requires `point` at q, and if `biased` nle at (q, v); sets
  // `multipliers`.
  void accelerate(double t, const double* q, const double* v, const double* s, double* vdot, double* rates,
                  bool biased);
  // y' (ny,) and lam (ng,) from the hidden constraint.
  void derivative(double t, const double* y, double* F, double* z);
  // Like derivative(), without Baumgarte terms, at the end of a step. Keeps the rows in use, and reuses the last stage
  // if it agrees to rounding.
  void hidden_derivative(double t, const double* y, double* F, double* z);
  // dy/dt (length,) of raw coordinates, dq/dt = T(q) v, at normalized q (index1.cpp).
  void raw_derivative(double t, const double* y, double* dy, double* z);
  // Between two steps: select rows, and record the largest violations. True if the rows changed; then v is projected
  // onto them, and the carry is restarted.
  bool update_independent_rows(double t, State& s);

  // The last stage of a step; its poses are saved if rows are in use.
  struct LastStage {
    double t = NAN;
    long motion_stamp = -1;     // stamp of the tree
    Vector q, v, s, f, rates;  // (nq,), (nv,), (ns,), (nv,), (ns + 1,)
  } last_stage;

  std::vector<SampledController> samplers;
  // Replace the state before t by that after t, if t is a sampling instant; late: see `SampledController::has_jumped`.
  void apply_jumps(double t, double* y, double late = INFINITY);
  struct {
    Vector g, gap, next_g, rate, x, trial_q;  // (ng,) four times, (nv,), (nq,)
  } projection;  // scratch of `project_state`
  double potential(const double* q);  // potential energy of gravity and springs in J, at the current poses

  void add(const double* y, const double* x, double* out) const;  // y (+) x
  // out = in (+) x with compensated summation; x (ny,) with in.low added.
  void move(const State& in, double* x, State& out) const;
  void difference(const double* y0, const double* y1, double* out) const;
  void component_magnitudes(const double* y, double* out);  // in the tangent, (ny,)

  const std::vector<Pair>& law_pairs() const { return law_pairs_; }
  const Vector& multipliers() const { return lam_; }  // (ng,) of the rows in use, of the last `derivative`
  void residual_rate(double t, const double* v, double* rate) const;  // G v + g_t of all rows, with current G
  SmallestPivot smallest_pivot(const double* q, int rank);            // see mbdae/mechanism/singularity.py; not counted
  double pivot_ratio(const double* q, int rank) { return smallest_pivot(q, rank).ratio; }

 private:
  void set_laws(std::vector<Law> laws, const std::vector<std::pair<Anchor, Anchor>>& pairs);
  void use_nodes(const Description& d);  // compute only nodes of flexible bodies that its frame pairs use
  bool is_last_stage(double t, const double* q, const double* v, const double* s) const;

  std::vector<Pair> law_pairs_;
  std::vector<Law> laws_;
  const Vector probe_;               // (nv,)
  const double alpha_, beta_;         // 1/s
  Vector nonconservative_, f_;        // (nv,)
  Vector lam_, gt_, g_, rate_;     // (ng,)
  Vector all_G_;                     // (ng, nv)
  Vector law_partials_, dtau_dq_, dtau_dv_;  // (2 nv + ns, 2 nv + ns), (nv, nv) twice
};

}  // namespace mbdae
