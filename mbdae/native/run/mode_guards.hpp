// Guards of a mode: their values from step to step, and their first root in a step
// (mbdae/integrate/events/guard_location.py, multiplier_resolution.py). Python handles rare cases.
#pragma once

#include <list>
#include <utility>
#include <vector>

#include "run/event_detection.hpp"
#include "run/switches.hpp"

namespace mbdae {

// A function of the state that is positive while a switch keeps its state, tracked from step to step (Guard and
// TrackedGuard in Python).
struct Guard {
  enum Kind { contact, separation, slip, zero_velocity, range_boundary };

  Kind kind;
  int element;           // index of its switch
  double sign;           // sign of its value
  double reference = 0;  // last tooth of a ratchet, in pitches
  double size = 0;           // largest magnitude so far
  double level = 0;          // value at which the mode ends
  double return_time = NAN;  // s: after the contact closure predicted for an impact; nan: none
  double unit = 0;           // typical magnitude

  bool monitors_multiplier() const { return kind == separation || kind == slip; }
  bool needs_multipliers() const { return monitors_multiplier() || kind == range_boundary; }
};

// A change of the mode, or an impact in the same mode.
struct Transition {
  long node = -1;                 // the first node after it
  std::vector<int> fired;         // switches whose guards are zero
  bool impact = false;            // whether there is an impact
  std::vector<int> contacts;      // switches with an impulse
  std::vector<int> engaged;       // rows that become active in the impact
  double work = 0;                // J: change of kinetic energy
  Vector impulses;                // (ng,) of all rows
  Mode mode;                      // the next mode
};

// The switches of a run, the guards of its mode, the transitions of the last steps, and settings.
struct Modes {
  std::vector<Switch> switches;
  std::vector<int> unswitched;  // rows without switches
  Mode mode;
  Vector last_impact;  // s, of each switch
  std::vector<Guard> guards;
  std::vector<Transition> transitions;
  bool in_core = false;            // whether the core checks steps
  bool undecided = false;          // Python must take the next step
  double characteristic_rate = 0;  // 1/s
  // relative to the largest speed or multiplier: zero in impacts and complementarity problems
  double mode_rounding = 0;
  double return_factor = 0;  // factor of the predicted duration of a separation, after which the gap is negative
  double start_root = 0;     // relative to a bracket: a root this close to an impact is the impact
  double grazing = 0;        // relative to the gaps at the ends of a step: a minimum above it is no contact
  double spacings = 0, step_tolerance = 0;  // location tolerance: spacings of t, and relative to the step
  int iterations = 0;            // largest number of iterations of Newton's method
  int root_iterations = 0, max_halvings = 0;  // largest numbers of Brent iterations, and of halvings of a bracket
  // monitored multipliers: largest deviation from a cubic, relative to the distance from the limit; smallest such
  // distance; distance of extrema from the limit; extrapolation beyond five samples
  double rough = 0, near_limit = 0, close_extremum = 0, outside = 0;
  int finest = 0;                 // largest number of intervals between samples in a step of fixed size
  double safety = 0, shrink = 0;  // factor of the step that resolves the multipliers; smallest ratio of step sizes
  double shortest = 0;            // s: step that resolves all multipliers
  double coincident = 0;          // relative to a pitch, or to the friction limit
  double transverse = 0;          // relative to the largest speed at rest: a slower contact does not slide
  double at_limit = 0;            // relative to the friction limit: a contact with friction closer to it slides
  double lookahead = 0;           // rad or characteristic lengths: added to a coordinate at the boundary of a range
  double ambiguous = 0, fallen = 0;     // pivot ratios in a new mode, see IndependentRows::InitialRank
  int max_impacts = 0, max_states = 0;  // successive impacts at one time; states of a complementarity problem

  IndependentRows::InitialRank initial_rank(const Tolerances& tolerances) const {
    return {ambiguous, fallen, tolerances.solution_rounding};
  }

  FIELDS(in_core, undecided, mode, last_impact, unswitched, characteristic_rate, mode_rounding, return_factor,
         start_root, grazing, spacings, step_tolerance, iterations, root_iterations, max_halvings, rough, near_limit,
         close_extremum, outside, finest, safety, shrink, shortest, coincident, transverse, at_limit, lookahead, ambiguous,
         fallen, max_impacts, max_states)
};

void check(const Modes& m, const Index2System& s);  // std::invalid_argument: not valid for the mechanism

std::vector<Guard> guards_of(const std::vector<Switch>& switches, const Mode& mode);

// Largest inertial plus reaction force at the current point, where y' = F: scale of the rounding error of multipliers.
double largest_force(Index2System& s, const double* y, const double* F, const double* lam);

// Signed utilization of the limit of a sticking joint at the current point: lam / limit if the sticking rows are
// independent. If several rows prevent the same motion, so that their torques are statically indeterminate: their work
// in this motion over the work of their limits. Otherwise FallBackToPython.
double stiction_utilization(const Index2System& s, const std::vector<Switch>& switches, const Mode& mode, int element,
                            const Vector& lam);

class GuardMonitor {
 public:
  GuardMonitor(Index2System& s, Modes& modes) : s_(s), modes_(modes) {}

  bool checks_steps() const { return modes_.in_core && !modes_.guards.empty(); }
  // Begin to check a step; return the largest resolution error of a multiplier relative to the tolerance. `refines`:
  // add samples until they resolve it, for a step of fixed size.
  double begin_step(const AcceptedStep& step, const PartialStep& partial_step, bool refines);
  std::vector<int> first_roots(double& theta);  // guards that are first zero in the step, and at which fraction
  void advance() { advance(point(1)); }         // to the end of the step
  // Track the guards of a new mode from y on, where y' = F.
  void track(double t, const double* y, const Vector& F, const Vector& lam);

  // Guards at a point of a solution by another program (FMI).
  struct Value {
    double f, rate;  // rate: 0 if unknown
  };
  struct Values {
    std::vector<Value> guards;  // minus their levels
    Vector tolerances;
  };
  Values values(double t, const double* y, const Vector& F, const Vector& lam, bool advances);
  // s: end of the first quarter of the predicted separation after an impact, in which other methods may not resolve the
  // gap; -inf: none.
  double first_quarter_of_flight(int i) const;

 private:
  struct Point {
    double theta, t;
    Vector y = {}, g = {}, rate = {}, acceleration = {};  // (length,), (ng,) of the rows of switches
    Vector F = {}, lam = {};                              // (ny,), (ng,)
    double force = 0;                                     // largest force, see `largest_force`
  };

  void prepare();  // set the rows of the guards of the mode
  void set_references(const Point& p);
  void advance(const Point& p);
  void evaluate(Point& p);
  const Point& point(double theta);
  double value(const Guard& guard, const Point& p);
  double rate(const Guard& guard, const Point& p) const;
  // The multiplier that steps must resolve: of a slip guard relative to its limit, signed; of a separation guard, >= 0.
  double monitored_multiplier(const Guard& guard, const Point& p);
  Value at(const Point& p, int i) {  // minus its level
    return {value(modes_.guards[i], p) - modes_.guards[i].level, rate(modes_.guards[i], p)};
  }
  Value at(double theta, int i) { return at(point(theta), i); }
  bool has_rate(const Guard& guard) const;
  const Switch& of(const Guard& guard) const { return modes_.switches[guard.element]; }
  void set_reference(Guard& guard, const Point& p) const;
  double unit(const Guard& guard, const Point& p) const;
  double speed(const Point& p) const;  // the largest scaled velocity plus the characteristic rate
  double rounding(int i) const {
    return s_.tree.tolerances.evaluation_rounding * (modes_.guards[i].unit + modes_.guards[i].size);
  }

  bool depends_on_one_multiplier(const Guard& guard) const;
  Vector interpolated_multipliers(const Guard& guard);  // at the samples, on the Hermite cubic
  double resolution_error();
  double resolution_error(const Guard& guard);
  Vector monitored_multipliers(const Guard& guard);  // at the samples, by partial steps
  double longest_step(const Guard& guard, const Point& p) const;
  std::vector<double> samples(int i);  // fractions of the step at which a guard is sampled
  double negative_fraction(int i);     // a fraction at which the guard is negative; 0: none
  double locate(int i, double high);
  double locate_by_quartic(int i, double high);  // for a guard without rate, sampled at quarters of the step
  double locate_by_brent(int i, double high);
  double time_tolerance() const;  // tolerance of a root, relative to the step
  [[noreturn]] void fall_back_to_python() const { throw FallBackToPython(); }

  Index2System& s_;
  Modes& modes_;
  bool dynamic_ = false;         // values require y' and lam
  bool has_references_ = false;  // references are set
  int intervals_ = 4;          // between samples of a step
  std::vector<int> rows_;      // rows of switches
  Vector G_;                   // entries by rows
  const AcceptedStep* step_ = nullptr;
  const PartialStep* partial_step_ = nullptr;
  std::list<Point> points_;
  std::vector<Point> interpolated_;  // points at the samples
};

}  // namespace mbdae
