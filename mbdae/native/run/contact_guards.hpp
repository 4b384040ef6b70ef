// Guards of open contacts in many steps, and impacts at which a single contact rebounds: the mode stays the same. All
// other roots of guards are left to Python (mbdae/integrate/events/guard_location.py, hybrid.py,
// mbdae/mechanism/hybrid/impact.py).
#pragma once

#include <utility>

#include "run/event_detection.hpp"

namespace mbdae {

// A guard as tracked from step to step (TrackedGuard in Python).
struct TrackedGuard {
  double size = 0;           // largest magnitude so far
  double level = 0;          // value at which the contact closes
  double return_time = NAN;  // s: predicted end of a flight after an impact; nan: none
  double last_impact = NAN;  // s
};

struct ContactGuard : TrackedGuard {
  int row = 0;
  double sign = 1;         // of the gap, sign * g
  double restitution = 0;  // 0: impacts are left to Python
  double rest = 0;         // s: duration below which a flight ends in rest

  FIELDS(row, sign, restitution, rest)
};

// An impact at which a contact rebounds.
struct Rebound {
  long node = -1;    // the first one after it
  int guard = -1;
  double work = 0;   // J: the change of kinetic energy
  Numbers impulses;  // (ng,) of all rows
};

// All guards of the mode, and the impacts of the last steps.
struct ContactGuards {
  std::vector<ContactGuard> guards;
  std::vector<Rebound> impacts;
  bool in_core = false;          // whether steps are checked here
  bool undecided = false;        // the next step has a root that is left to Python
  double characteristic_rate = 0;  // 1/s
  double mode_rounding = 0;      // of the largest speed: zero in impact problems
  double return_factor = 0;      // of a predicted flight time: the gap is then negative again
  double start_root = 0;         // of a bracket: after an impact, a root this close to the start is the start
  double grazing = 0;            // of the gaps at both ends of a step: a minimum between them above it is no contact
  double spacings = 0, step_tolerance = 0;  // location tolerance: spacings of t, and relative to the step
  int iterations = 0;            // of Newton's method

  FIELDS(in_core, undecided, characteristic_rate, mode_rounding, return_factor, start_root, grazing, spacings,
         step_tolerance, iterations)
};

class ContactMonitor {
 public:
  ContactMonitor(Index2System& s, ContactGuards& all);

  bool checks_steps() const { return all_.in_core && !all_.guards.empty(); }
  // The guard of the contact that closes in a step, and the fraction of the step; -1: none.
  int first_root(const AcceptedStep& step, const PartialStep& shorter, double& theta);
  void advance();  // to the end of this step
  // Impact at y (length,), where `s.point` is current: the contact of a guard rebounds; y becomes the point after it.
  Rebound rebound(int guard, double t, double* y);
  void track(double t, const double* y, const double* F);  // from the start of a smooth interval on

 private:
  struct Gaps {
    double theta;
    Numbers value, rate;  // of each guard
  };
  struct Value {
    double f, rate;
  };

  Gaps gaps(double t, const double* y);  // and G of their rows
  Value at(double theta, int i);         // minus its level
  double negative_fraction(int i);       // a fraction of the step at which a guard is negative; 0: it stays positive
  double locate(int i, double high);
  double rounding(int i) const;
  double time_tolerance() const;  // of a root, relative to the step
  double gap_acceleration(int i, const double* y, const double* F);
  Numbers all_impulses(const Numbers& in_use) const;  // those of minimum norm in characteristic lengths
  [[noreturn]] void leave_to_python() const { throw FallBackToPython(); }

  Index2System& s_;
  ContactGuards& all_;
  std::vector<int> rows_;
  Numbers G_, Z_;  // (ng, nv) the rows of guards
  const AcceptedStep* step_ = nullptr;
  const PartialStep* shorter_ = nullptr;
  std::vector<Gaps> known_;
};

}  // namespace mbdae
