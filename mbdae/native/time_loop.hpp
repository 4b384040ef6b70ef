// Many steps in a row: what mbdae/integrate/loop.py does where nothing unusual happens.
#pragma once

#include <utility>
#include <vector>

#include "projection.hpp"
#include "step.hpp"
#include "step_control.hpp"

namespace mbdae {

// The watch for singular configurations, in ratios of pivots (mbdae/integrate/singularity_watch.py).
struct SingularWatch {
  double usual = 0, before = 0;  // the largest so far, and the last
  double suspect = 0, landed = 0, zone = 0;
};

// The steps that were taken, n of them.
struct Steps {
  Numbers t, least_pivot_ratio;  // (n,); least_pivot_ratio: smallest ratio of pivots that each of them met
  Numbers y, z;        // (n, length), (n, ng) by rows
  std::vector<std::pair<long, std::vector<int>>> changes;  // after how many steps which rows came into use
};

// What a run hands over, and gets back.
struct Run {
  Leg leg;
  State state;
  StepControl control;
  Grid grid;
  SingularWatch watch;
  bool adaptive = false;  // by control; else on the grid
  bool project = false;   // the ends of steps
  bool watched = false;   // by the watch
  double tolerated = 0;   // fixed steps: what a projection may move a state whose derivative is kept
  double seconds = 0;     // of computing, or little more
  long budget = 0;        // steps taken or rejected, at most

  Steps steps;
  long taken = 0, rejected = 0;
  bool stuck = false;  // the next step is not for the core
};

class TimeLoop {
 public:
  TimeLoop(HalfExplicitStep& step, Index2System& system, const Tableau& tableau, Run& run);

  void advance();  // take steps until something asks for Python

 private:
  bool attempt();          // a step; false where Python has something to say about it
  bool judge(double h);    // is it accepted?
  void project(double t);  // its end
  bool landing();          // does a fixed step lead into a singular configuration where another can be taken?
  double error_norm(const double* e, int errors, double noise) const;

  HalfExplicitStep& step_;
  Index2System& s_;
  const Tableau& tableau_;
  Run& run_;
  State next_;
  Numbers errors_;         // (errors, ny)
  Numbers size0_, size1_;  // (ny,) magnitudes at the start and the end of a step
  Numbers z_;              // (ng,) multipliers of the method
};

}  // namespace mbdae
