// The time loop: steps of a run, with events, jumps and monitors (mbdae/integrate/run/loop.py), until Python is needed.
#pragma once

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "steps/collocation.hpp"
#include "run/jumps.hpp"
#include "run/mode_transition.hpp"
#include "system/projection.hpp"
#include "steps/half_explicit_step.hpp"
#include "run/step_control.hpp"

namespace mbdae {

// Singularity monitor, by pivot ratios (mbdae/integrate/events/singularity.py, singularity_location.py).
struct SingularityMonitor {
  double largest_ratio = 0, last_ratio = 0;  // the largest ratio so far, and the last
  double mode_ratio = 0;                     // the largest ratio in the mode so far
  // thresholds relative to the largest, or to the last ratio
  double suspicious_ratio = 0, singular_ratio = 0, monitored_ratio = 0;
  double notch_ratio = 0;      // relative to the larger ratio of neighbouring steps
  double small_ratio = 0;      // relative to the largest: a smaller minimum may contain a zero
  double adjacent_ratio = 0;   // relative to the largest: no fixed step begins at a smaller ratio
  double max_change = 0;       // relative change of the ratio at the start of an interval, in a linear step backward
  double steps_ahead = 0;      // Python takes over if a decreasing ratio would vanish within these steps
  bool near_singular = false;  // the ratio is already small
  bool suspicious = false;     // there may be a singular configuration around a recorded step
  bool by_mode = false;        // largest_ratio is that of the mode; of the run if Python inspects suspicious steps
  std::map<Mode, double> ratio_by_mode;  // the largest ratio of each mode when it was last left

  void update(double ratio) {
    last_ratio = ratio, largest_ratio = std::max(largest_ratio, ratio), mode_ratio = std::max(mode_ratio, ratio);
  }
  // The largest ratio to expect in a mode, from the smallest pivots before it and in it.
  double expected_ratio(const Mode& mode, const SmallestPivot& previous, const SmallestPivot& current) const;
  void enter(const Mode& previous, double largest);  // enter a mode with this largest ratio

  FIELDS(largest_ratio, last_ratio, mode_ratio, suspicious_ratio, singular_ratio, monitored_ratio, notch_ratio,
         small_ratio, adjacent_ratio, max_change, steps_ahead, near_singular, suspicious, by_mode)
};

// The nodes of n steps and jumps.
struct Steps {
  Vector t, least_pivot_ratio;                             // (n,); smallest pivot ratio in the step to each node
  Vector y, z;                                             // (n, length), (n, nz) by rows
  std::vector<std::pair<long, std::vector<int>>> changes;  // nodes at which the rows in use change, and the new rows
  Vector carry;                                            // (k, nc) by rows: carry at the first k nodes
  std::vector<long> restarted;                             // nodes at which the carry was restarted
  std::vector<long> after_jumps;                           // nodes after jumps, where no step ends
};

// Input and output of a run.
struct Run {
  SmoothInterval interval;
  State state;
  StepControl control;
  Grid grid;
  SingularityMonitor monitor;
  Events events;
  Jumps jumps;
  Modes modes;
  bool adaptive = false;      // whether step sizes are controlled; otherwise nodes are on the grid
  bool project = false;       // whether ends of steps are projected
  bool monitored = false;     // whether the singularity monitor is used
  double tolerated_move = 0;  // fraction of a state: largest projection after fixed steps that keeps the carry
  double tiny = 0;            // lower bound of scales, if a state is zero
  // fraction of the motion of a step that a projection may undo, beyond tolerances
  double max_undone = 0;
  bool continued = false;     // whether the steps of earlier calls are kept
  double seconds = 0;         // limit of computing time, checked after each step
  long max_steps = 0;         // largest number of steps, taken or rejected
  long max_carries = 0;       // largest number of nodes with a recorded carry

  Steps steps;
  long taken = 0, rejected = 0;
  bool needs_python = false;  // whether the next step needs Python

  FIELDS(interval, control, grid, monitor, events, jumps, modes, adaptive, project, monitored, tolerated_move, tiny,
         max_undone, continued, seconds, max_steps, max_carries, taken, rejected, needs_python)
};

// A method that takes the steps of a run.
class Method {
 public:
  virtual ~Method() = default;
  virtual void take(bool controlled, double t, double h, const State& in, State& out, double* z, Vector& errors) = 0;

  const int errors;    // error estimates of a controlled step
  const double noise;  // factor by which the rounding of v exceeds eps |v|
  const bool carries;  // whether it has a carry

 protected:
  Method(int errors_, double noise_, bool carries_) : errors(errors_), noise(noise_), carries(carries_) {}
};

class HalfExplicitMethod final : public Method {
 public:
  HalfExplicitMethod(HalfExplicitStep& step, const Tableau& a)
      : Method(a.doubling_order ? 1 : a.errors, a.noise, a.explicit_first), step_(step), a_(a) {}
  void take(bool controlled, double t, double h, const State& in, State& out, double* z, Vector& errors) override {
    controlled ? step_.controlled(a_, t, h, in, out, z, errors) : step_.take(a_, t, h, in, out, z, errors);
  }

 private:
  HalfExplicitStep& step_;
  const Tableau& a_;
};

class CollocationMethod final : public Method {
 public:
  CollocationMethod(CollocationStep& step, const Radau& a) : Method(a.errors, 0, true), step_(step), a_(a) {}
  void take(bool controlled, double t, double h, const State& in, State& out, double* z, Vector& errors) override {
    step_.take(a_, controlled, t, h, in, out, z, errors);
  }

 private:
  CollocationStep& step_;
  const Radau& a_;
};

// A method without error estimate: VariationalStep, NewmarkStep.
template <class Step, class Coefficients>
class FixedStepMethod final : public Method {
 public:
  FixedStepMethod(Step& step, const Coefficients& a, bool carries) : Method(0, 0, carries), step_(step), a_(a) {}
  void take(bool, double t, double h, const State& in, State& out, double* z, Vector& errors) override {
    errors.clear(), step_.take(a_, t, h, in, out, z);
  }

 private:
  Step& step_;
  const Coefficients& a_;
};

class TimeLoop {
 public:
  TimeLoop(Method& method, Index2System& system, Run& run);

  void advance();  // take steps until Python is needed

 private:
  bool attempt();                              // attempt a step; false: Python must handle the failure
  bool accept(double h);                       // whether the step is accepted
  bool shorten(double h);                      // after a step that was too long; false: the shorter size is too small
  void project(double t);                      // project the end of the step
  double move_norm(const Vector& x) const;     // norm of a displacement by a projection, relative to tolerances
  bool undoes_step(double h, double projection_norm);  // whether the projection has undone the step
  class PartialSteps;
  void detect_events(Proposal& p);  // on the last step, which is truncated if an event ends the run
  // Find the guards that end the mode in the last step, and truncate it. False: it does not resolve the multipliers.
  bool detect_transition(Proposal& p, std::vector<int>& fired);
  // Check guards and select the rows of the next step; false: the step is too long, or the mode ends at its start.
  bool complete_step(Proposal& p);
  // Whether the state after an event approaches a singular configuration, in a mode with this largest ratio.
  bool is_near_singular(const NextMode& next, double largest);
  void resolve_transition(const std::vector<int>& fired, double t, bool immediate);  // at the end of the step
  void apply_transition();               // add the state after a transition as a node
  bool apply_jump();                     // apply the jump after an interval; false: Python must handle it
  void begin_interval(const Vector& z);  // at the current state, after a jump or a transition
  void record();                    // record the state
  bool ends_singular();  // whether a fixed step ends in a singular configuration before the end of the interval
  double error_norm(const double* e, int errors, double noise) const;

  Method& method_;
  Index2System& s_;
  Run& run_;
  State next_;
  Vector unprojected_, displacement_, partial_displacement_;  // (length,) next_.y before its projection; (ny,) twice
  bool restarted_ = false;                    // the carry of next_ was restarted
  DetectedEvents detected_;          // on the accepted step
  GuardMonitor guards_;
  NextMode next_mode_;         // after the event at the end of the accepted step
  Mode previous_mode_;         // the mode before the event
  double next_mode_ratio_ = 0;  // the largest pivot ratio to expect in the next mode
  bool changes_mode_ = false;   // whether a transition is pending
  int immediate_ = 0;          // events since the last step
  Vector errors_;              // (errors, ny)
  Vector size0_, size1_;       // (ny,) magnitudes at the start and the end of a step
  Vector z_;                   // (nz,) multipliers of the method
  Configuration other_configuration_;  // storage for the configuration of the run during event location
};

}  // namespace mbdae
