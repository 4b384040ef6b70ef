// Guards of open contacts, and of closed ones without friction, in many steps, and impacts at which one contact rebounds
// while closed ones stay closed: the mode stays the same. All else is left to Python, as all roots of loads
// (mbdae/integrate/events/guard_location.py, load_resolution.py, hybrid.py, mbdae/mechanism/hybrid/impact.py).
#pragma once

#include <utility>

#include "run/event_detection.hpp"

namespace mbdae {

// A guard as tracked from step to step (TrackedGuard in Python).
struct TrackedGuard {
  double size = 0;           // largest magnitude so far
  double level = 0;          // value at which the contact closes
  double return_time = NAN;  // s: predicted end of a flight after an impact; nan: none
  double unit = 0;           // typical size
  double last_impact = NAN;  // s
};

struct ContactGuard : TrackedGuard {
  int row = 0;
  double sign = 1;         // of the gap, sign * g, and of the load, sign * lam
  bool closed = false;     // then the guard is the load
  double restitution = 0;  // 0: impacts are left to Python
  double rest = 0;         // s: duration below which a flight ends in rest
  int no_slip = -1;        // the tangential row of a contact with friction; -1: none
  double friction = 0;     // its coefficient

  FIELDS(row, sign, closed, restitution, rest, no_slip, friction)
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
  int root_iterations = 0, max_halvings = 0;  // of Brent's method; of a bracket
  // of loads: largest deviation from a cubic and its scale, extrema close to zero, and how far outside five samples
  double rough = 0, near_limit = 0, close_extremum = 0, outside = 0;
  double safety = 0, shrink = 0;  // of the largest step that resolves the loads; smallest ratio of consecutive steps
  double shortest = 0;            // s: step that resolves all loads

  FIELDS(in_core, undecided, characteristic_rate, mode_rounding, return_factor, start_root, grazing, spacings,
         step_tolerance, iterations, root_iterations, max_halvings, rough, near_limit, close_extremum, outside, safety,
         shrink, shortest)
};

class ContactMonitor {
 public:
  ContactMonitor(Index2System& s, ContactGuards& all);

  bool checks_steps() const { return all_.in_core && !all_.guards.empty(); }
  // Begin to check a step; return the largest step that resolves its loads, which have no root.
  double check_loads(const AcceptedStep& step, const PartialStep& shorter);
  int first_root(double& theta);  // the guard of the contact that closes in the step, and the fraction; -1: none
  void advance();  // to the end of this step
  // Impact at y (length,), where `s.point` is current: the contact of a guard rebounds; y becomes the point after it.
  Rebound rebound(int guard, double t, double* y);
  // From the start of a smooth interval on, with y' and lam; loads must be positive.
  void require_loads(const double* y, const double* F, const double* lam);
  void track(double t, const double* y, const double* F, const double* lam);

 private:
  struct Gaps {
    double theta;
    Numbers value, rate;  // of each guard
  };
  struct Value {
    double f, rate;
  };

  struct Response {  // to a unit impulse along a row (nv,), closures kept: velocities (nv,) and their impulses (ng,)
    Numbers row, v, lam;
  };

  Response response(int row, double sign);
  Gaps gaps(double t, const double* y);  // and G of their rows
  Value at(double theta, int i);         // minus its level
  double negative_fraction(int i);       // a fraction of the step at which a guard is negative; 0: it stays positive
  double locate(int i, double high);
  double rounding(int i) const;
  double locate_by_brent(int i, double high);
  double load_rounding(const double* y, const double* F, const double* lam);  // of multipliers, at the current point
  // Unresolved part of five equidistant loads, relative to the tolerance.
  double unresolved(int i, const double* load, double rounding) const;
  double time_tolerance() const;  // of a root, relative to the step
  double gap_acceleration(int i, const double* y, const double* F);
  bool redundant() const;  // do active rows depend on those in use?
  Numbers all_impulses(const Numbers& in_use) const;  // those of minimum norm in characteristic lengths
  [[noreturn]] void leave_to_python() const { throw FallBackToPython(); }

  Index2System& s_;
  ContactGuards& all_;
  std::vector<int> rows_, evaluated_;  // of guards; and tangential ones
  bool loaded_ = false;  // is a contact closed?
  Numbers G_, Z_;  // (ng, nv) the rows of guards
  const AcceptedStep* step_ = nullptr;
  const PartialStep* shorter_ = nullptr;
  std::vector<Gaps> known_;
  Numbers end_loads_;  // of each guard
};

}  // namespace mbdae
