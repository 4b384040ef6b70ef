// Guards of a mode, checked in many steps, and their first root (mbdae/integrate/events/guard_location.py,
// multiplier_resolution.py). Rare cases are left to Python.
#pragma once

#include <list>
#include <utility>
#include <vector>

#include "run/event_detection.hpp"
#include "run/switches.hpp"

namespace mbdae {

// A function of the point that is positive as long as a state lasts, tracked from step to step (Guard, TrackedGuard in
// Python).
struct Guard {
  enum Kind { contact, separation, slip, zero_velocity, range_boundary };

  Kind kind;
  int element;           // index of its switch
  double sign;           // of its value
  double reference = 0;  // last tooth of a ratchet, in pitches
  double size = 0;           // largest magnitude so far
  double level = 0;          // value at which the mode ends
  double return_time = NAN;  // s: predicted end of a flight after an impact; nan: none
  double unit = 0;           // typical size

  bool monitors_multiplier() const { return kind == separation || kind == slip; }
  bool needs_multipliers() const { return monitors_multiplier() || kind == range_boundary; }
};

// A change of the mode, or an impact in the same mode.
struct Transition {
  long node = -1;                 // the first one after it
  std::vector<int> fired;         // switches whose guards are zero
  bool impact = false;            // of these contacts, and bilateral rows that become active:
  std::vector<int> contacts, engaged;
  double work = 0;                // J: the change of kinetic energy
  Vector impulses;                // (ng,) of all rows
  Mode mode;                      // after it
};

// All switches and their guards in the mode of a run, and the transitions of the last steps.
struct Modes {
  std::vector<Switch> switches;
  std::vector<int> unswitched;   // rows
  Mode mode;
  Vector last_impact;  // s, of each switch
  std::vector<Guard> guards;
  std::vector<Transition> transitions;
  bool in_core = false;          // whether steps are checked here
  bool undecided = false;        // the next step is left to Python
  double characteristic_rate = 0;  // 1/s
  double mode_rounding = 0;      // of the largest speed or multiplier: zero in impact and complementarity problems
  double return_factor = 0;      // of a predicted flight time: the gap is then negative again
  double start_root = 0;         // of a bracket: after an impact, a root this close to the start is the start
  double grazing = 0;            // of the gaps at both ends of a step: a minimum between them above it is no contact
  double spacings = 0, step_tolerance = 0;  // location tolerance: spacings of t, and relative to the step
  int iterations = 0;            // of Newton's method
  int root_iterations = 0, max_halvings = 0;  // of Brent's method; of a bracket
  // of monitored multipliers: largest deviation from a cubic and its scale, extrema close to the limit, and how far
  // outside five samples
  double rough = 0, near_limit = 0, close_extremum = 0, outside = 0;
  int finest = 0;                 // largest number of intervals between samples in a step of fixed size
  double safety = 0, shrink = 0;  // of the largest step that resolves the multipliers; smallest ratio of step sizes
  double shortest = 0;            // s: step that resolves all multipliers
  double coincident = 0;          // of a pitch, or of the limit of friction
  double transverse = 0;          // of the speed of rest: a slower contact does not slide
  double at_limit = 0;            // of the limit of friction: a contact slides whose friction is closer to it
  double lookahead = 0;           // rad or characteristic lengths: of a joint at the boundary of a range
  double ambiguous = 0, fallen = 0;  // ratios of pivots in a new mode, see IndependentRows::InitialRank
  int max_impacts = 0, max_states = 0;        // successive impacts at an instant; states of a complementarity problem

  IndependentRows::InitialRank initial_rank(const Tolerances& limits) const {
    return {ambiguous, fallen, limits.solution_rounding};
  }

  FIELDS(in_core, undecided, mode, last_impact, unswitched, characteristic_rate, mode_rounding, return_factor,
         start_root, grazing, spacings, step_tolerance, iterations, root_iterations, max_halvings, rough, near_limit,
         close_extremum, outside, finest, safety, shrink, shortest, coincident, transverse, at_limit, lookahead, ambiguous,
         fallen, max_impacts, max_states)
};

void check(const Modes& m, const Index2System& s);  // std::invalid_argument where they do not fit

std::vector<Guard> guards_of(const std::vector<Switch>& switches, const Mode& mode);

// Rounding error of multipliers at the current point, where y' and lam are F and lam, over that of solved systems.
double largest_force(Index2System& s, const double* y, const double* F, const double* lam);

// Utilization of the limit of a sticking joint, with sign, at the current point of a mode: lam / limit where sticking
// rows are independent; where they prevent one motion together, so that their torques are indeterminate, the work of all
// over that of all limits along it. Otherwise FallBackToPython.
double stiction_utilization(const Index2System& s, const std::vector<Switch>& switches, const Mode& mode, int element,
                            const Vector& lam);

class GuardMonitor {
 public:
  GuardMonitor(Index2System& s, Modes& modes) : s_(s), modes_(modes) {}

  bool checks_steps() const { return modes_.in_core && !modes_.guards.empty(); }
  // Begin to check a step; return the largest resolution error of a multiplier relative to the tolerance. `refines`:
  // with as many samples as resolve it, for a step of fixed size.
  double begin_step(const AcceptedStep& step, const PartialStep& partial_step, bool refines);
  std::vector<int> first_roots(double& theta);  // guards that end the mode in the step together, and the fraction
  void advance() { advance(point(1)); }  // to the end of this step
  // Guards of a new mode, from y on, where y' and lam are F and lam.
  void track(double t, const double* y, const Vector& F, const Vector& lam);

  // Guards at a point of another program's solution.
  struct Value {
    double f, rate;  // rate: 0 where it is unknown
  };
  struct Values {
    std::vector<Value> guards;  // less their levels
    Vector tolerances;
  };
  Values values(double t, const double* y, const Vector& F, const Vector& lam, bool advances);
  // s: end of the first quarter of the flight after an impact, whose gap a step of another method may not resolve;
  // -inf: no flight.
  double takeoff_end(int i) const;

 private:
  struct Point {
    double theta, t;
    Vector y = {}, g = {}, rate = {}, acceleration = {};  // (length,), (ng,) of the rows of switches
    Vector F = {}, lam = {};                              // (ny,), (ng,)
    double force = 0;                  // the largest one
  };

  void prepare();  // for the guards of the mode
  void set_references(const Point& p);
  void advance(const Point& p);
  void evaluate(Point& p);
  const Point& point(double theta);
  double value(const Guard& guard, const Point& p);
  double rate(const Guard& guard, const Point& p) const;
  // The multiplier that steps must resolve: for a slip, over its limit, signed; for a separation, itself, >= 0.
  double monitored_multiplier(const Guard& guard, const Point& p);
  Value at(const Point& p, int i) {  // minus its level
    return {value(modes_.guards[i], p) - modes_.guards[i].level, rate(modes_.guards[i], p)};
  }
  Value at(double theta, int i) { return at(point(theta), i); }
  bool has_rate(const Guard& guard) const;
  const Switch& of(const Guard& guard) const { return modes_.switches[guard.element]; }
  void set_reference(Guard& guard, const Point& p) const;
  double unit(const Guard& guard, const Point& p) const;
  double speed(const Point& p) const;  // the largest one, and the characteristic rate
  double rounding(int i) const {
    return s_.tree.limits.evaluation_rounding * (modes_.guards[i].unit + modes_.guards[i].size);
  }

  bool depends_on_one_multiplier(const Guard& guard) const;
  Vector interpolated_multipliers(const Guard& guard);  // at the samples, on a cubic
  double resolution_error();
  double resolution_error(const Guard& guard);
  Vector monitored_multipliers(const Guard& guard);  // at the samples, points of steps
  double longest_step(const Guard& guard, const Point& p) const;
  std::vector<double> samples(int i);  // fractions of the step at which a guard is sampled
  double negative_fraction(int i);     // a fraction at which a guard is negative; 0: it stays positive
  double locate(int i, double high);
  double locate_by_quartic(int i, double high);  // of a guard without a rate, sampled at quarters of the step
  double locate_by_brent(int i, double high);
  double time_tolerance() const;  // of a root, relative to the step
  [[noreturn]] void leave_to_python() const { throw FallBackToPython(); }

  Index2System& s_;
  Modes& modes_;
  bool dynamic_ = false;       // do values need y' and lam?
  bool referenced_ = false;    // are references set?
  int intervals_ = 4;          // between samples of a step
  std::vector<int> rows_;      // of switches
  Vector G_;                   // entries by rows
  const AcceptedStep* step_ = nullptr;
  const PartialStep* partial_step_ = nullptr;
  std::list<Point> known_;
  std::vector<Point> interpolated_;  // at the samples
};

}  // namespace mbdae
