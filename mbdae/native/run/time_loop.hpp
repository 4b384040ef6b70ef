// Many steps in a row: mbdae/integrate/run/loop.py without its special cases.
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

// Singularity monitor, in ratios of pivots (mbdae/integrate/events/singularity.py, singularity_location.py).
struct SingularityMonitor {
  double largest_ratio = 0, last_ratio = 0;                              // the largest so far, and the last
  double mode_ratio = 0;                                                 // the largest in the mode so far
  double suspicious_ratio = 0, singular_ratio = 0, monitored_ratio = 0;  // thresholds: of the largest, or of the last
  double notch_ratio = 0;      // of the larger ratio of neighbouring steps
  double small_ratio = 0;      // of the largest: minima below may contain a zero
  double adjacent_ratio = 0;   // of the largest: no fixed step begins there
  double max_change = 0;       // of the ratio at the start of an interval, over a linear backward step
  double steps_ahead = 0;      // in which a decreasing ratio would vanish: then Python takes over
  bool near_singular = false;  // the ratio is small already
  bool suspicious = false;     // there may be a singular configuration around a recorded step
  bool by_mode = false;        // is the largest ratio that of the mode? Where Python inspects suspicious steps, of the run
  std::map<Mode, double> ratio_by_mode;  // the largest ratio of each mode when it was last left

  void update(double ratio) {
    last_ratio = ratio, largest_ratio = std::max(largest_ratio, ratio), mode_ratio = std::max(mode_ratio, ratio);
  }
  // The largest ratio to count with in a mode, where these are the smallest pivots before it and in it.
  double largest_in(const Mode& mode, const SmallestPivot& before, const SmallestPivot& here) const;
  void enter(const Mode& left, double largest);  // a mode with this largest ratio

  FIELDS(largest_ratio, last_ratio, mode_ratio, suspicious_ratio, singular_ratio, monitored_ratio, notch_ratio,
         small_ratio, adjacent_ratio, max_change, steps_ahead, near_singular, suspicious, by_mode)
};

// The nodes of n steps and jumps.
struct Steps {
  Vector t, least_pivot_ratio;                             // (n,); smallest ratio of pivots in the step to each node
  Vector y, z;                                             // (n, length), (n, nz) by rows
  std::vector<std::pair<long, std::vector<int>>> changes;  // nodes at which rows came into use, and these rows
  Vector carry;                                            // (k, nc) by rows: carry from the first k nodes
  std::vector<long> restarted;                             // nodes at which it was recomputed
  std::vector<long> after_jumps;                           // nodes where no step ends
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
  bool adaptive = false;      // with step-size control; otherwise on the grid
  bool project = false;       // the ends of steps
  bool monitored = false;     // by the singularity monitor
  double tolerated_move = 0;  // of the magnitude of a state: by a projection after fixed steps that keeps the carry
  double tiny = 0;            // keeps scales positive where a state is zero
  double max_undone = 0;      // of the motion of a step: what a projection may undo beyond tolerances
  bool continued = false;     // keep the steps of earlier calls
  double seconds = 0;         // of computing, checked after each step
  long max_steps = 0;         // taken or rejected
  long max_carries = 0;       // nodes with a recorded carry

  Steps steps;
  long taken = 0, rejected = 0;
  bool needs_python = false;  // for the next step

  FIELDS(interval, control, grid, monitor, events, jumps, modes, adaptive, project, monitored, tolerated_move, tiny,
         max_undone, continued, seconds, max_steps, max_carries, taken, rejected, needs_python)
};

// A method that takes the steps of a run.
class Method {
 public:
  virtual ~Method() = default;
  virtual void take(bool controlled, double t, double h, const State& in, State& out, double* z, Vector& errors) = 0;

  const int errors;    // error estimates of a controlled step
  const double noise;  // rounding of v by which they exceed eps |v|
  const bool carries;  // a derivative or stages from step to step

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
  bool attempt();          // a step; false if Python must handle the failure
  bool accept(double h);   // is it accepted?
  bool shorten(double h);  // after a step that was too long; false where a shorter one is too short
  void project(double t);  // its end
  double move_norm(const Vector& move) const;  // of the projected end of a step, in tolerances
  bool undoes_step(double h, double moved);  // did the projection, by this norm, undo the step?
  class PartialSteps;
  void detect_events(Proposal& p);  // on the step just taken, which is cut where an event ends the run
  // The guards that end the mode in it, where it is cut. False if the step does not resolve its multipliers.
  bool detect_transition(Proposal& p, std::vector<int>& fired);
  // Check guards, and select the rows of the next step; false if it is too long, or the mode ends where it begins.
  bool complete_step(Proposal& p);
  // Does the point after an event, in a mode with this largest ratio, approach a singular configuration?
  bool is_near_singular(const NextMode& next, double largest);
  void resolve_transition(const std::vector<int>& fired, double t, bool immediate);  // at the end of the step
  void apply_transition();                       // the point after it is the next node
  bool apply_jump();                // the jump after an interval; false if Python must handle it
  void begin_interval(const Vector& z);  // at the current state, after a jump or a transition
  void record();                    // record the state
  bool ends_singular();  // does a fixed step end in a singular configuration although another step is possible?
  double error_norm(const double* e, int errors, double noise) const;

  Method& method_;
  Index2System& s_;
  Run& run_;
  State next_;
  Vector unprojected_, move_, partial_move_;  // (length,) next_.y before its projection; (ny,) twice
  bool restarted_ = false;  // its carry was recomputed
  DetectedEvents detected_;          // on the accepted step
  GuardMonitor guards_;
  NextMode next_mode_;         // after the event at the end of the accepted step
  Mode left_mode_;             // before it
  double next_mode_ratio_ = 0;  // the largest pivot ratio to count with in the next mode
  bool changes_mode_ = false;  // is there one?
  int immediate_ = 0;          // events since the last step
  Vector errors_;              // (errors, ny)
  Vector size0_, size1_;       // (ny,) magnitudes at the start and the end of a step
  Vector z_;                   // (nz,) multipliers of the method
  Configuration other_configuration_;  // storage for that of the run during event location
};

}  // namespace mbdae
