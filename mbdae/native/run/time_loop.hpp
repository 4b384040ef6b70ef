// Many steps in a row: mbdae/integrate/loop.py without its special cases.
#pragma once

#include <utility>
#include <vector>

#include "steps/collocation.hpp"
#include "run/event_detection.hpp"
#include "run/jumps.hpp"
#include "system/projection.hpp"
#include "steps/half_explicit_step.hpp"
#include "run/step_control.hpp"

namespace mbdae {

// Singularity monitor, in ratios of pivots (mbdae/integrate/singularity_monitor.py).
struct SingularityMonitor {
  double usual = 0, before = 0;  // the largest so far, and the last
  double suspect = 0, landed = 0, zone = 0;
  double ahead = 0;      // steps within which a decreasing ratio would vanish: then Python takes over
  bool entered = false;  // it does so already
};

// The nodes of n steps and jumps.
struct Steps {
  Numbers t, least_pivot_ratio;  // (n,); least_pivot_ratio: smallest ratio of pivots in the step to each of them
  Numbers y, z;        // (n, length), (n, nz) by rows
  std::vector<std::pair<long, std::vector<int>>> changes;  // nodes at which rows came into use, and these rows
  Numbers carry;                                           // (k, nc) by rows: carry from the first k nodes
  std::vector<long> renewed;                               // nodes at which it was recomputed
  std::vector<long> behind;                                // nodes after a jump: no step ends there
};

// Input and output of a run.
struct Run {
  SmoothInterval leg;
  State state;
  StepControl control;
  Grid grid;
  SingularityMonitor watch;
  Events events;
  Jumps jumps;
  bool adaptive = false;  // with step-size control; otherwise on the grid
  bool project = false;   // the ends of steps
  bool watched = false;   // by the watch
  double tolerated = 0;   // fixed steps: what a projection may move a state whose derivative is kept
  double nothing = 0;     // keeps it positive where a state is zero
  double taken_back = 0;  // of the motion of a step: what a projection may undo beyond tolerances
  double seconds = 0;     // of computing, or little more
  long budget = 0;        // steps taken or rejected, at most
  long kept = 0;          // maximum number of nodes with a recorded carry

  Steps steps;
  long taken = 0, rejected = 0;
  bool stuck = false;  // the next step must be taken in Python
};

// A method that takes the steps of a run.
class Method {
 public:
  virtual ~Method() = default;
  virtual void take(bool controlled, double t, double h, const State& in, State& out, double* z, Numbers& errors) = 0;

  const int errors;    // error estimates of a controlled step
  const double noise;  // rounding of v by which they exceed eps |v|
  const bool carries;  // a derivative or stages from step to step

 protected:
  Method(int errors_, double noise_, bool carries_) : errors(errors_), noise(noise_), carries(carries_) {}
};

class HalfExplicitMethod final : public Method {
 public:
  HalfExplicitMethod(HalfExplicitStep& step, const Tableau& a)
      : Method(a.doubled ? 1 : a.errors, a.noise, a.first), step_(step), a_(a) {}
  void take(bool controlled, double t, double h, const State& in, State& out, double* z, Numbers& errors) override {
    controlled ? step_.controlled(a_, t, h, in, out, z, errors) : step_.take(a_, t, h, in, out, z, errors);
  }

 private:
  HalfExplicitStep& step_;
  const Tableau& a_;
};

class CollocationMethod final : public Method {
 public:
  CollocationMethod(CollocationStep& step, const Radau& a) : Method(a.errors, 0, true), step_(step), a_(a) {}
  void take(bool controlled, double t, double h, const State& in, State& out, double* z, Numbers& errors) override {
    step_.take(a_, controlled, t, h, in, out, z, errors);
  }

 private:
  CollocationStep& step_;
  const Radau& a_;
};

class TimeLoop {
 public:
  TimeLoop(Method& method, Index2System& system, Run& run);

  void advance();  // take steps until Python is needed

 private:
  bool attempt();          // a step; false if Python must handle the failure
  bool judge(double h);    // is it accepted?
  bool shorten(double h);  // after a step that was too long; false where a shorter one is too short
  void project(double t);  // its end
  double measure(const Numbers& move) const;  // of the projected end of a step, in tolerances
  bool taken_back(double h, const Numbers& y, const Numbers& move) const;  // did it undo the step, which led to y?
  void look(Proposal& p);  // for events on the step just taken, which ends where one ends the run
  bool cross();            // the jump behind a leg; false where Python has something to say about it
  void push();             // record the state
  bool landing();          // does a fixed step end in a singular configuration although another step is possible?
  double error_norm(const double* e, int errors, double noise) const;

  Method& method_;
  Index2System& s_;
  Run& run_;
  State next_;
  bool renewed_ = false;   // its carry was recomputed
  EventScan seen_;              // on the accepted step
  Numbers errors_;         // (errors, ny)
  Numbers size0_, size1_;  // (ny,) magnitudes at the start and the end of a step
  Numbers z_;              // (nz,) multipliers of the method
  Configuration aside_;            // storage for that of the run during event location
};

}  // namespace mbdae
